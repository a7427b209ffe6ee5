"""Where the strings of a skin lie on their link, and what a pair of neighbours leaves unfelt."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Annotated, TypeAlias

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from monochord.core.errors import InputError
from monochord.core.lengths import LONGEST
from monochord.core.ranges import Checked, Count, Finite
from monochord.core.types import Floats
from monochord.core.units import Metres
from monochord.physics.sensors import Sensor, load_sensor, refuse_other_length

Coordinate: TypeAlias = Annotated[Metres, Meta(ge=-LONGEST, le=LONGEST)]
Place: TypeAlias = tuple[Coordinate, Coordinate, Coordinate]
Direction: TypeAlias = tuple[Finite[float], Finite[float], Finite[float]]
MIN_LENGTH: Metres = 1e-6
"""Smallest distance of a string's ends; below it, they are one point."""
MIN_ACROSS = 0.5
"""Smallest share of a press that is across its string: within 30 degrees of it, an axis was mistyped."""
SAME_DISTANCE = 1.0 + 1e-9
"""Ratio up to which two distances count as one: strings in a regular ring."""


@dataclass(frozen=True, kw_only=True)
class SkinString(Checked):
    """One string of a skin, in the frame of its link.

    Parameters
    ----------
    start, end
        The string's ends in m, that at pickup 1 first.
    press
        Direction of a touch's force on the string, of any length. Its part along the string is left out,
        since a string resists none.
    sensor
        A sensor preset, or a file written by `tune`; its string is as long as the ends are apart.
    channels
        Channels of the audio interface, counted from 1; by default the two after the previous string's.
    press_std
        Standard error of the press's direction about the string, in rad.

    Examples
    --------
    >>> string = SkinString(start=(0, 0, 0.1), end=(0, 0, 0.3), press=(-2, 0, 0), sensor="prototype")
    >>> string.at(0.05).tolist(), string.direction.tolist()
    ([0.0, 0.0, 0.15], [-1.0, 0.0, 0.0])
    """

    start: Place
    end: Place
    press: Direction
    sensor: str
    channels: tuple[Count, ...] = ()
    press_std: Annotated[float, "rad", Meta(ge=0.0, le=1.0)] = 0.0

    @cached_property
    def loaded(self) -> Sensor:
        """The sensor of the preset or file."""
        return load_sensor(self.sensor)

    @cached_property
    def along(self) -> Floats:
        """What a metre of the sensor's position is on the link, (3,); of length 1 where both agree.

        Sound tells where a touch divides its string, so a position is taken as a share of the string.
        """
        return _kept((np.asarray(self.end) - np.asarray(self.start)) / self.loaded.string.length)

    @cached_property
    def direction(self) -> Floats:
        """Unit vector (3,) of a touch's force on the string, across it."""
        axis = _unit(self.along)
        press = _unit(self.press)
        return _kept(_unit(press - (axis @ press) * axis))

    def at(self, position: Metres | Floats) -> Floats:
        """Return the point (3,) of the link at a position from pickup 1, or points (n, 3) at n positions."""
        return np.asarray(self.start) + np.multiply.outer(position, self.along)

    def check(self, name: str) -> None:
        """Raise `InputError` for ends or a press that no string has; `name` is the string's."""
        span = np.subtract(self.end, self.start)
        length = float(np.linalg.norm(span))
        if length < MIN_LENGTH:
            given = f"string {name} from {_shown(self.start)} to {_shown(self.end)}"
            raise InputError(given, "two different ends", "name where it leaves its pins, in m")
        if not any(self.press):
            raise InputError(f"string {name}: press (0, 0, 0)", "the direction of a touch's force")
        across = float(np.linalg.norm(np.cross(span / length, _unit(self.press))))
        if across < MIN_ACROSS:
            angle = f"{math.degrees(math.asin(across)):.0f} degrees from the string"
            given = f"string {name}: press {_shown(self.press)}, {angle}"
            raise InputError(given, "a direction across it", "name that of a touch")
        remedy = "measure between the saddle pins, or name another sensor"
        refuse_other_length(length, self.loaded.string.length, f"string {name}: ends", remedy)


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbours:
    """Two strings with none between them, and what an object does there unfelt.

    Attributes
    ----------
    first, second
        The strings' names.
    distance
        Smallest distance of the two in m. A ball of up to this diameter passes between them.
    sink
        How deep a flat plate lies in the skin, in m, when it first touches them: below the cylinder on which
        both strings lie, midway, s = (d / 2) tan(a / 4) where their presses differ by the angle a. It is 0
        for a flat or hollow skin.
    angle
        Between the directions in which the two are pressed, in rad.
    """

    first: str
    second: str
    distance: Metres
    sink: Metres
    angle: float

    def __str__(self) -> str:
        """Return the geometry as text."""
        apart, sink, angle = 1e3 * self.distance, 1e3 * self.sink, math.degrees(self.angle)
        return (
            f"{self.first} and {self.second}: {apart:.1f} mm apart, a smaller ball passes between them; "
            f"a plate sinks {sink:.1f} mm; presses {angle:.0f} degrees apart"
        )


def neighbours(strings: Mapping[str, SkinString]) -> Iterator[Neighbours]:
    """Yield the pairs of strings between which no other lies, judged by their middles.

    A pair are neighbours where the ball between their middles holds no third one (Gabriel's graph).
    """
    middles = {name: 0.5 * np.add(each.start, each.end) for name, each in strings.items()}
    for (first, one), (second, other) in combinations(middles.items(), 2):
        centre, radius = 0.5 * (one + other), 0.5 * float(np.linalg.norm(other - one))
        others = [each for name, each in middles.items() if name not in (first, second)]
        if not any(np.linalg.norm(each - centre) <= radius * SAME_DISTANCE for each in others):
            yield _pair(first, second, strings[first], strings[second])


def _pair(first: str, second: str, one: SkinString, other: SkinString) -> Neighbours:
    distance = _distance(one, other)
    across = float(np.linalg.norm(np.cross(one.direction, other.direction)))
    angle = math.atan2(across, float(one.direction @ other.direction))
    apart = 0.5 * (np.add(other.start, other.end) - np.add(one.start, one.end))
    convex = float(apart @ (other.direction - one.direction)) < 0.0  # they are pressed towards each other
    sink = 0.5 * distance * math.tan(0.25 * angle) if convex else 0.0
    return Neighbours(first=first, second=second, distance=distance, sink=sink, angle=angle)


def _distance(one: SkinString, other: SkinString) -> Metres:
    """Return the smallest distance of two strings in m."""
    from scipy.optimize import lsq_linear  # noqa: PLC0415  (takes time to load, and few look at neighbours)

    spans = np.column_stack([np.subtract(one.end, one.start), np.subtract(other.start, other.end)])
    between = np.subtract(other.start, one.start)
    return float(np.linalg.norm(spans @ lsq_linear(spans, between, (0.0, 1.0)).x - between))


def _unit(vector: ArrayLike) -> Floats:
    """Return a vector (3,) at length 1; any but zero, however small or large."""
    scaled = np.asarray(vector) / np.abs(vector).max()
    return scaled / np.linalg.norm(scaled)


def _kept(vector: Floats) -> Floats:
    """Return a vector that is read again and again, and that nobody can write to."""
    vector.flags.writeable = False
    return vector


def _shown(place: Place | Direction) -> str:
    return f"({', '.join(f'{each:g}' for each in place)})"
