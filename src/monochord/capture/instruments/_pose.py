"""Shared by the pose instruments: their feed, and checks of a pose."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from monochord.core.errors import InputError
from monochord.core.types import POSE, Feed
from monochord.core.units import Hertz

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
FARTHEST = 1e7
"""Largest coordinate in m, a quarter of the Earth's circumference; anything larger is an error."""
LONGEST_TURN = 1e6
"""Largest length of a quaternion that is normalised; a longer one is invalid."""


def pose_feed(rate: Hertz, details: Mapping[str, str]) -> Feed:
    """Return the feed of a pose with `rate` readings per second; 0 if the rate is unknown."""
    if not 0.0 <= rate <= 100e3:
        raise InputError(f"rate of {rate} Hz", "0 to 100000 Hz, 0 where unknown")
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
    """Return x, y, z and a unit quaternion, or None for an invalid pose.

    A pose is invalid where a number is not finite or absurdly large (beyond `FARTHEST` m), or the quaternion
    has length 0.

    >>> unit_pose((0.1, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0))
    (0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    """
    norm = math.hypot(*orientation)
    if not (all(abs(part) <= FARTHEST for part in position) and 1e-6 < norm < LONGEST_TURN):
        return None  # NaN too is not within any bound
    return (*position, *(part / norm for part in orientation))


def quaternion_of(rotation: str, numbers: Sequence[float]) -> tuple[float, ...]:
    """Return the quaternion x, y, z, w of three angles in rad, or of the four numbers of a quaternion.

    ``vector`` is the rotation axis times the angle, v: q = (v / |v| sin(|v| / 2), cos(|v| / 2)).
    ``fixed_xyz`` rotates about the fixed axes x, then y, then z, by roll, pitch and yaw: R = Rz Ry Rx.
    ``moving_xyz`` rotates about x, then about the rotated y and z axes: R = Rx Ry Rz. ``moving_zyx`` (A, B, C
    of KUKA: R = Rz(A) Ry(B) Rx(C)) and ``moving_zyz`` rotate about the axes that they name. ``wxyz`` and
    ``xyzw`` are quaternions with w first and last.

    >>> [round(part, 3) for part in quaternion_of("fixed_xyz", (0.0, 0.0, math.pi / 2))]
    [0.0, 0.0, 0.707, 0.707]
    >>> [round(part, 3) for part in quaternion_of("moving_zyx", (math.pi / 2, 0.0, 0.0))]
    [0.0, 0.0, 0.707, 0.707]
    """
    if rotation == "xyzw":
        return tuple(numbers)
    if rotation == "wxyz":
        return (*numbers[1:], numbers[0])
    if rotation == "vector":
        angle = math.hypot(*numbers)
        scale = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
        x, y, z = (scale * part for part in numbers)
        return x, y, z, math.cos(0.5 * angle)
    frame, _, axes = rotation.partition("_")
    whole = UPRIGHT
    for axis, angle in zip(axes, numbers, strict=True):
        turn = _about(axis, angle)
        whole = _product(whole, turn) if frame == "moving" else _product(turn, whole)
    return whole


def _about(axis: str, angle: float) -> tuple[float, float, float, float]:
    """Return the quaternion of a turn about x, y or z."""
    x, y, z = (math.sin(0.5 * angle) * (axis == each) for each in "xyz")
    return x, y, z, math.cos(0.5 * angle)


def _product(
    p: tuple[float, float, float, float], q: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    """Return the quaternion of the turn q followed by p, both in the fixed frame: R = R(p) R(q)."""
    return (
        p[3] * q[0] + p[0] * q[3] + p[1] * q[2] - p[2] * q[1],
        p[3] * q[1] + p[1] * q[3] + p[2] * q[0] - p[0] * q[2],
        p[3] * q[2] + p[2] * q[3] + p[0] * q[1] - p[1] * q[0],
        p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2],
    )
