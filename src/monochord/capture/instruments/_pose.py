"""What instruments of the robot's pose share: their feed, and what a pose may be."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from monochord.core.errors import InputError
from monochord.core.types import POSE, Feed
from monochord.core.units import Hertz

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
FARTHEST = 1e7
"""Metres along each axis, a quarter of the way round the Earth: who says more says nonsense."""
LONGEST_TURN = 1e6
"""Of a quaternion that is not of length 1, which is made so."""


def pose_feed(rate: Hertz, details: Mapping[str, str]) -> Feed:
    """Return the feed of a pose that is due `rate` times a second; 0 where that is not known."""
    if not 0.0 <= rate <= 100e3:
        raise InputError(f"rate of {rate} Hz", "0 to 100000 Hz, 0 where it is not known")
    units = ("m",) * 3 + ("",) * 4
    return Feed(
        stream="pose",
        columns=POSE,
        units=units,
        rate=rate,
        ticks=1e9,
        details=MappingProxyType(dict(details)),
    )


def unit_pose(position: Sequence[float], orientation: Sequence[float]) -> tuple[float, ...] | None:
    """Return x, y, z and a unit quaternion, or None where that is no pose.

    That is where a number is not finite or absurd (beyond `FARTHEST` m), or the quaternion turns nothing.

    >>> unit_pose((0.1, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0))
    (0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    """
    norm = math.hypot(*orientation)
    if not (all(abs(part) <= FARTHEST for part in position) and 1e-6 < norm < LONGEST_TURN):
        return None  # NaN too is not within any bound
    return (*position, *(part / norm for part in orientation))
