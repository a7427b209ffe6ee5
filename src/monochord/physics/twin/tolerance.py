"""How much sensors of one design differ, and one sensor from week to week.

All are standard deviations, and assumed unless a source is named; a preset may state its own.
"""

from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from monochord.core.units import Metres, Newtons

Share = Annotated[float, Meta(ge=0.0, le=0.3)]
"""A standard deviation relative to the value."""
Small = Annotated[Metres, Meta(ge=0.0, le=0.005)]
"""A standard deviation of a place or length, in m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """How another sensor of the same design differs.

    The wire: `diameter` is a share; ASTM A228 allows 0.3 thousandths of an inch on a music wire of .010, 3 %
    or three of these deviations. `tuning` is the error of whoever tunes it to its pitch by ear or meter,
    in cents. `length` is that between the ends, `places` that of each of the four coils, `aperture` a
    coil's width as it acts.

    The drivers: `gain`, `limit`, `centre` and `quality` are shares, of coils wound, glued and set at a
    height by hand; `tilt` is that of drivers and pickups about the string, in radians. The pickups:
    `pickup_gain` is a share, 0.12 being a decibel of piezo and preamplifier; `own` is what of l1 and l2
    depends on how the frame is mounted, as it is. `losses` is a share of each loss factor.
    """

    diameter: Share = 0.01
    tuning: Annotated[float, Meta(ge=0.0, le=100.0)] = 10.0
    length: Small = 2.5e-4
    places: Small = 5.0e-4
    aperture: Share = 0.05
    gain: Share = 0.10
    limit: Share = 0.10
    centre: Share = 0.05
    quality: Share = 0.05
    tilt: Annotated[float, Meta(ge=0.0, le=0.3)] = 0.05
    pickup_gain: Share = 0.12
    own: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.03
    losses: Share = 0.20


@dataclass(frozen=True, slots=True, kw_only=True)
class Changes:
    """How the same sensor differs on another day.

    `temperature` is that of frame and string together since the string was tuned, in K: a room in daily
    use. `creep` is what string and tuner have given since, in N. `warming` is how fast the temperature
    moves within a session, in K an hour. `gain` and `limit` are shares, for a battery and the height of an
    EBow that was put back, `pickup_gain` a share, 0.035 being 0.3 dB, for knobs set again by their marks.
    """

    temperature: Annotated[float, Meta(ge=0.0, le=30.0)] = 3.0
    creep: Annotated[Newtons, Meta(ge=0.0, le=5.0)] = 0.05
    warming: Annotated[float, Meta(ge=0.0, le=60.0)] = 1.5
    gain: Share = 0.05
    limit: Share = 0.05
    pickup_gain: Share = 0.035
