"""A script of moves, and the trajectory that it gives: keys for the twin, named phases, and the tool's path.

The virtual laboratory's robot and the simulated sources describe every touch with it.

Frame: x along the string from the end of pickup 1, y across it, z the height above the string at rest, all of
the tool's touching point. Of the two directions of slip that Yi, Xing, Manchester and Fazeli (Sound of Touch)
name, a slide along the string, in x, is the horizontal one here, one across it, in y, the vertical one.

`Press` and `Slide` hold a depth, since a robot holds its place and not its force; a slide along the string so
changes the force a little. `Waypoint` sets a force instead. Between two keys position, force, height and the
speed across run linearly, and the path of the tool follows from the keys: y integrates the speed across, z is
the height less the string's depth.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import ceil, hypot, pi, sin

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats, StringParams
from monochord.core.units import Hertz, Metres, MetresPerSecond, Newtons, Seconds
from monochord.physics.setup import Key
from monochord.physics.theory import geometric_tension, stretch_stiffness

TRAVEL_HEIGHT: Metres = 3e-3
"""How far above the string the tool travels: many times the string's swing."""
ACCELERATION = 1.5
"""Acceleration of the robot's tool in m/s^2: assumed, in the range of a seven-axis arm of 14 kg payload."""
RAMP_SEGMENTS = 4
"""Number of straight segments into which a change of speed is cut."""
MAX_SEGMENT: Metres = 4e-3
"""Longest straight segment at full speed: along the string, the depth is exact at a segment's ends only."""
MAX_FORCE: Newtons = 10.0
"""Force at which the robot presses no deeper: what a key may have."""
TAP_SINK = 0.4
"""Largest share of a tap's contact time in which it goes down, and goes up again."""
SWAY_POINTS = 8
"""Straight segments of half a period of a sway."""
HOP_HEIGHT: Metres = 1e-3
"""Height of a hop: several times the string's swing."""
HOP_PRESS: MetresPerSecond = 0.2
"""Speed at which a hop leaves the string and presses it again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stay:
    """Do nothing for `seconds`, in the air or pressed; `kind` names the phase: rest, settle, hold."""

    seconds: Seconds
    kind: str = "hold"


@dataclass(frozen=True, slots=True, kw_only=True)
class Travel:
    """Go to x = `position`, y = 0 at the present height, in the air."""

    position: Metres
    speed: MetresPerSecond = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class Press:
    """Approach and press, or press on, to the `depth` or until the string at rest answers with `force`.

    Give one of the two. Approach and press are one move, which slows down to rest at the depth.
    """

    depth: Metres | None = None
    force: Newtons | None = None
    speed: MetresPerSecond = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """Come down from the air to `height` above the string at rest, without touching it."""

    height: Metres
    speed: MetresPerSecond = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Slide:
    """Move by `along` in x and `across` in y at `speed`, at the present depth; `kind` names the phase."""

    along: Metres = 0.0
    across: Metres = 0.0
    speed: MetresPerSecond = 0.01
    kind: str = "slide"


@dataclass(frozen=True, slots=True, kw_only=True)
class Retreat:
    """Release the string and rise to `height` above it."""

    height: Metres = TRAVEL_HEIGHT
    speed: MetresPerSecond = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Tap:
    """A sharp tap from the present height and back to it: down and up at one speed, without a rest.

    The turn is sudden, as a tap's is, and so are its ends: only taps and hops exceed the robot's
    acceleration. With a `contact` in s, the tool stays at its deepest point until that much time has passed
    from meeting the string to leaving it, and is faster where it would not be deep by then. `kind` names the
    phase: those of "tap" align the streams.
    """

    force: Newtons = 1.0
    speed: MetresPerSecond = 0.2
    contact: Seconds | None = None
    kind: str = "tap"


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """Change the force linearly to `force` within `seconds`, at the present place of a pressed string."""

    force: Newtons
    seconds: Seconds
    kind: str = "hold"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sway:
    """Swing along the string about the present place, by `amplitude` to either side at `rate` in Hz.

    It grows over the first half period and fades over the last; the number of half periods is whole.
    """

    amplitude: Metres
    rate: Hertz
    seconds: Seconds
    kind: str = "sway"


@dataclass(frozen=True, slots=True, kw_only=True)
class Hop:
    """Leave the string, and press it at `position` to `depth` after `seconds` without contact.

    It takes as long as one finger lifts and another one lands, which is faster than the robot.
    """

    position: Metres
    depth: Metres
    seconds: Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """Run linearly to a state that is reached at `time`, counted as the trajectory counts.

    A `position` of None keeps the position. `force` is normal force in N, `clearance` the height in m of a
    tool that does not touch, `across` the speed in m/s across the string. One that is due at the time of the
    move before replaces that move's end.
    """

    time: Seconds
    position: Metres | None = None
    force: Newtons = 0.0
    clearance: Metres = 0.0
    across: MetresPerSecond = 0.0
    kind: str = "hold"


Move = Stay | Travel | Approach | Press | Slide | Retreat | Tap | Load | Sway | Hop | Waypoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A part of a trajectory: rest, travel, approach, press, settle, hold, slide, release, tap and others."""

    kind: str
    start: Seconds
    stop: Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """A whole motion over one string: `keys` for the twin, and the `phases` that they make up."""

    string: StringParams
    keys: tuple[Key, ...]
    phases: tuple[Phase, ...]

    @property
    def end(self) -> Seconds:
        """Time at which the last move ends, in s."""
        return self.keys[-1].time

    @property
    def taps(self) -> tuple[Seconds, ...]:
        """Times at which the tool is deepest in each tap, in s."""
        return tuple(0.5 * (p.start + p.stop) for p in self.phases if p.kind == "tap")

    def path(self, time: Floats) -> Floats:
        """Return the tool's place x, y, z in m at times (n,) in s, (n, 3)."""
        keys = np.array([[k.time, k.position, k.force, k.clearance, k.across] for k in self.keys])
        at = np.clip(time, keys[0, 0], keys[-1, 0])
        x, force, clearance = (np.interp(at, keys[:, 0], keys[:, column]) for column in (1, 2, 3))
        step = np.diff(keys[:, 0])
        distance = np.concatenate([[0.0], np.cumsum(step * 0.5 * (keys[1:, 4] + keys[:-1, 4]))])
        i = np.clip(np.searchsorted(keys[:, 0], at, side="right") - 1, 0, len(step) - 1)
        past = at - keys[i, 0]
        y = distance[i] + past * (keys[i, 4] + 0.5 * past * (keys[i + 1, 4] - keys[i, 4]) / step[i])
        return np.stack([x, y, clearance - depth_under(self.string, x, force)], axis=1)

    def lifted(self, offset: Metres) -> "Trajectory":
        """Return the same motion `offset` higher, in which the tool never meets the string, except in taps.

        Raises `InputError` where the tool would still reach the string.
        """
        taps = [(phase.start, phase.stop) for phase in self.phases if phase.kind == "tap"]
        keys: list[Key] = []
        for key in self.keys:
            if any(start <= key.time <= stop for start, stop in taps):
                keys.append(key)
                continue
            depth = float(depth_under(self.string, key.position, key.force))
            if offset <= depth:
                raise InputError(f"clearance offset {offset:g} m", f"more than the depth, {depth:g} m")
            keys.append(replace(key, force=0.0, clearance=key.clearance - depth + offset))
        return replace(self, keys=tuple(keys))


def trajectory(
    moves: Iterable[Move], string: StringParams, *, position: Metres, begin: Seconds = 0.0
) -> Trajectory:
    """Return the trajectory of moves carried out in sequence from `begin` on, first at rest above `position`.

    The tool starts at `TRAVEL_HEIGHT`; the string converts between depths and forces. Raises `InputError` for
    a move that cannot be, such as a slide in no direction or a press without an end.

    >>> plain = StringParams(length=0.2, linear_density=4.0e-4, tension=65.0, core_diameter=2.54e-4)
    >>> motion = trajectory([Press(force=1.0), Stay(seconds=0.5), Retreat()], plain, position=0.1)
    >>> [phase.kind for phase in motion.phases]
    ['approach', 'press', 'hold', 'release', 'retreat']
    >>> float(motion.path(np.array([motion.phases[2].start]))[0, 2].round(6))
    -0.000766
    """
    planner = _Planner(string, position, begin)
    for move in moves:
        planner.add(move)
    return Trajectory(string=string, keys=tuple(planner.keys), phases=tuple(planner.phases))


class _Planner:
    """The tool between two moves, and the keys and phases so far; `height` is negative where it presses."""

    def __init__(self, string: StringParams, position: Metres, begin: Seconds) -> None:
        self.string = string
        self.time, self.x, self.y, self.height = begin, position, 0.0, TRAVEL_HEIGHT
        self.keys = [self._key(begin, position, TRAVEL_HEIGHT)]
        self.phases: list[Phase] = []

    def add(self, move: Move) -> None:
        """Carry out one move."""
        match move:
            case Stay():
                self._stay(move)
            case Travel():
                self._travel(move)
            case Slide():
                self._slide(move)
            case Press():
                self._move_vertically(-self._press_depth(move), move.speed, "approach", "press")
            case Approach() | Retreat():
                self._change_height(move)
            case Tap():
                self._tap(move)
            case Waypoint():
                self._go_to(move)
            case Load() | Sway() | Hop():
                self._while_pressed(move)

    def _key(self, time: Seconds, x: Metres, height: Metres, across: MetresPerSecond = 0.0) -> Key:
        force = min(float(force_at_depth(self.string, x, -height)), MAX_FORCE) if height < 0.0 else 0.0
        return Key(time=time, position=x, force=force, clearance=max(0.0, height), across=across)

    def _finish(self, kind: str, time: Seconds) -> None:
        self.phases.append(Phase(kind=kind, start=self.time, stop=time))
        self.time = time

    def _stay(self, move: Stay) -> None:
        if move.seconds <= 0.0:
            raise InputError(f"{move.kind} of {move.seconds:g} s", "more than 0 s")
        end = self.time + move.seconds
        self.keys.append(self._key(end, self.x, self.height))
        self._finish(move.kind, end)

    def _travel(self, move: Travel) -> None:
        if self.height <= 0.0:
            raise InputError("travel while pressing", "travel in the air", "retreat first")
        self._move_in_plane(move.position - self.x, -self.y, move.speed, "travel")

    def _slide(self, move: Slide) -> None:
        if move.along == move.across == 0.0:
            raise InputError("slide by 0 m", "a distance along or across the string")
        self._move_in_plane(move.along, move.across, move.speed, move.kind)

    def _change_height(self, move: Approach | Retreat) -> None:
        if isinstance(move, Retreat):
            self._move_vertically(move.height, move.speed, "retreat", "release")
            return
        if not 0.0 < move.height <= self.height:
            raise InputError(f"approach to {move.height:g} m", f"above 0 and up to {self.height:g} m")
        self._move_vertically(move.height, move.speed, "approach", "press")

    def _press_depth(self, move: Press) -> Metres:
        if (move.depth is None) == (move.force is None):
            raise InputError(f"press to depth {move.depth}, force {move.force}", "one of the two")
        if move.depth is None:
            depth = float(depth_under(self.string, self.x, move.force or 0.0))
        else:
            depth = move.depth
        if depth <= 0.0:
            raise InputError(f"press to a depth of {depth:g} m", "more than 0 m")
        return depth

    def _move_in_plane(self, along: Metres, across: Metres, speed: MetresPerSecond, kind: str) -> None:
        """Move in a straight line at the present height."""
        length = hypot(along, across)
        if length == 0.0:
            return
        for time, distance, velocity in speed_profile(length, speed):
            x = self.x + distance / length * along
            self.keys.append(self._key(self.time + time, x, self.height, velocity * across / length))
        self.x, self.y = self.x + along, self.y + across
        self._finish(kind, self.keys[-1].time)

    def _move_vertically(self, height: Metres, speed: MetresPerSecond, in_air: str, pressed: str) -> None:
        """Move up or down to a height; a key marks where the tool meets the string."""
        if height == self.height:
            return
        sign = 1.0 if height > self.height else -1.0
        meets: Seconds | None = None
        before, last = self.height, self.time
        for time, distance, _ in speed_profile(abs(height - self.height), speed):
            now = self.height + sign * distance
            if before * now < 0.0:
                share = before / (before - now)
                meets = last + share * (self.time + time - last)
                self.keys.append(self._key(meets, self.x, 0.0))
            before, last = now, self.time + time
            self.keys.append(self._key(last, self.x, now))
        if meets is None:
            self._finish(pressed if min(self.height, height) < 0.0 else in_air, last)
        else:
            first, second = (in_air, pressed) if sign < 0.0 else (pressed, in_air)
            self._finish(first, meets)
            self._finish(second, last)
        self.height = height

    def _tap(self, move: Tap) -> None:
        if self.height <= 0.0:
            raise InputError("tap while pressing", "tap from the air", "retreat first")
        depth = float(depth_under(self.string, self.x, move.force))
        fall, sink, stay = self.height / move.speed, depth / move.speed, 0.0
        if move.contact is not None:
            sink = min(sink, TAP_SINK * move.contact)
            stay = move.contact - 2.0 * sink
        for time, height in (
            (fall, 0.0),
            (fall + sink, -depth),
            *(((fall + sink + stay, -depth),) if stay > 0.0 else ()),
            (fall + 2.0 * sink + stay, 0.0),
            (2.0 * (fall + sink) + stay, self.height),
        ):
            self.keys.append(self._key(self.time + time, self.x, height))
        self._finish(move.kind, self.keys[-1].time)

    def _while_pressed(self, move: Load | Sway | Hop) -> None:
        if self.height >= 0.0:
            name = type(move).__name__.lower()
            raise InputError(f"{name} in the air", f"{name} while pressing", "press first")
        match move:
            case Load():
                self._load(move)
            case Sway():
                self._sway(move)
            case Hop():
                self._hop(move)

    def _load(self, move: Load) -> None:
        self.height = -float(depth_under(self.string, self.x, move.force))
        self._stay(Stay(seconds=move.seconds, kind=move.kind))

    def _sway(self, move: Sway) -> None:
        half_periods = max(2, round(2.0 * move.rate * move.seconds))
        count = SWAY_POINTS * half_periods
        for i in range(1, count + 1):
            halves = i / SWAY_POINTS
            share = min(1.0, halves, half_periods - halves)
            x = self.x + share * move.amplitude * sin(pi * halves)
            self.keys.append(self._key(self.time + move.seconds * i / count, x, self.height))
        self._finish(move.kind, self.keys[-1].time)

    def _hop(self, move: Hop) -> None:
        rise, quarter, x = -self.height / HOP_PRESS, 0.25 * move.seconds, move.position
        self.keys.append(self._key(self.time + rise, self.x, 0.0))
        self._finish("release", self.time + rise)
        self.keys.append(self._key(self.time + quarter, self.x, HOP_HEIGHT))
        self.keys.append(self._key(self.time + 3.0 * quarter, x, HOP_HEIGHT))
        self.keys.append(self._key(self.time + move.seconds, x, 0.0))
        self._finish("hop", self.time + move.seconds)
        self.x, self.height = x, -move.depth
        end = self.time + move.depth / HOP_PRESS
        self.keys.append(self._key(end, x, self.height))
        self._finish("press", end)

    def _go_to(self, move: Waypoint) -> None:
        key = Key(
            time=move.time,
            position=self.x if move.position is None else move.position,
            force=move.force,
            clearance=move.clearance,
            across=move.across,
        )
        if move.time <= self.time:
            self.keys[-1] = key
        else:
            self.y += 0.5 * (move.time - self.time) * (self.keys[-1].across + move.across)
            self.keys.append(key)
            self._finish(move.kind, move.time)
        self.x = key.position
        self.height = move.clearance - float(depth_under(self.string, self.x, move.force))


def speed_profile(distance: Metres, speed: MetresPerSecond) -> list[tuple[Seconds, Metres, MetresPerSecond]]:
    """Return points of a move from rest to rest: time, distance and speed there, without the first.

    The speed is a trapezoid over time, a triangle where the distance is too short for the full speed. Each
    slope is cut into `RAMP_SEGMENTS` of equal time, the stretch between them into segments of `MAX_SEGMENT`
    at most: the speed is exact between the points too, the distance at the points. `speed` is the highest.
    Raises `InputError` unless both are above 0.

    >>> points = speed_profile(0.03, 0.03)
    >>> [round(value, 4) for value in points[-1]]
    [1.02, 0.03, 0.0]
    >>> max(speed for _, _, speed in speed_profile(0.001, 0.2)) < 0.04
    True
    """
    if not (distance > 0.0 and speed > 0.0):
        raise InputError(f"a move of {distance:g} m at {speed:g} m/s", "more than 0 each")
    top = min(speed, (distance * ACCELERATION) ** 0.5)
    rise = top / ACCELERATION
    slope = 0.5 * top * rise
    flat = (distance - 2.0 * slope) / top
    points: list[tuple[Seconds, Metres, MetresPerSecond]] = []
    for i in range(1, RAMP_SEGMENTS + 1):
        share = i / RAMP_SEGMENTS
        points.append((share * rise, share**2 * slope, share * top))
    if flat > 1e-9:
        cuts = ceil(flat * top / MAX_SEGMENT)
        points += [(rise + i / cuts * flat, slope + i / cuts * flat * top, top) for i in range(1, cuts + 1)]
    end = points[-1][0]
    for i in range(1, RAMP_SEGMENTS + 1):
        left = 1.0 - i / RAMP_SEGMENTS
        points.append((end + (1.0 - left) * rise, distance - left**2 * slope, left * top))
    return points


def depth_under(string: StringParams, position: Metres | Floats, force: Newtons | Floats) -> Floats:
    """Return how deep a force presses a string where it acts.

    d = F x (L - x) / (T(F) L), with the tension of the geometric law. Holds for an ideally flexible string at
    rest, rigid ends and small slopes; the object's own compression, some micrometres, is left out. `position`
    x and the normal `force` F are of any shape, broadcast with each other; d counts from the string at rest.
    Raises `InputError` for a position outside the string and for a negative force.

    >>> plain = StringParams(length=0.2, linear_density=4.0e-4, tension=65.0, core_diameter=2.54e-4)
    >>> f"{depth_under(plain, 0.1, 1.0):.3e}"
    '7.657e-04'
    """
    tension = geometric_tension(string, position, force)  # pyright: ignore[reportArgumentType, reportCallIssue]
    return force * position * (string.length - position) / (tension * string.length)  # pyright: ignore[reportReturnType]


def force_at_depth(string: StringParams, position: Metres | Floats, depth: Metres | Floats) -> Floats:
    """Return the force with which a string answers a press to a depth: the inverse of `depth_under`.

    F = T d L / (x (L - x)) with T = T0 + E A d^2 / (2 x (L - x)): the geometric law, which is a plain
    polynomial where the depth is known: the cubic of `monochord.physics.theory.geometric_tension` with F put
    in terms of d, derived here. Holds where `depth_under` does, for arguments of the same kind.

    >>> plain = StringParams(length=0.2, linear_density=4.0e-4, tension=65.0, core_diameter=2.54e-4)
    >>> f"{force_at_depth(plain, 0.1, 7.657e-4):.3f}"
    '1.000'
    """
    both = position * (string.length - position)
    tension = string.tension + stretch_stiffness(string) * depth**2 / (2.0 * both)
    return tension * depth * string.length / both  # pyright: ignore[reportReturnType]
