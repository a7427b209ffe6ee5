"""What the robot does to the string: moves strung together, as keys of the twin and as a path of its tool.

The frame of the lab: x along the string from the end of pickup 1, y across it, z the height above the string
at rest, all of the tool's touching point. Of the two directions of slip that Yi, Xing, Manchester and Fazeli
(Sound of Touch) name, a slide along the string, in x, is the horizontal one here, one across it, in y, the
vertical one. Presses are to a depth, since a robot holds its place and not its force; a slide along the
string so changes the force a little.

The keys are the one truth. Between two of them position, force, height and the speed across run linearly, and
the path of the tool is read from them: y sums up the speed across, z is the height less the string's depth.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import hypot

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats, StringParams
from monochord.core.units import Metres, MetresPerSecond, Newtons, Seconds
from monochord.lab.glide import glide
from monochord.lab.pressing import depth_under, force_at_depth
from monochord.physics.twin import Key

HEIGHT: Metres = 3e-3
"""How far above the string the tool travels: many times the string's swing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stay:
    """Do nothing for `seconds`, in the air or pressed; `kind` says what for: rest, settle, hold."""

    seconds: Seconds
    kind: str = "hold"


@dataclass(frozen=True, slots=True, kw_only=True)
class Travel:
    """Go to x = `position`, y = 0 at the height that the tool has, in the air."""

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
class Slide:
    """Move by `along` in x and `across` in y at `speed`, at the depth that the tool has."""

    along: Metres = 0.0
    across: Metres = 0.0
    speed: MetresPerSecond = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Retreat:
    """Let go and rise to `height` above the string."""

    height: Metres = HEIGHT
    speed: MetresPerSecond = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Tap:
    """A sharp tap from the height that the tool has and back to it: down and up at one speed, no rest.

    The turn is sudden, as a tap's is, and so are its ends: only taps go beyond the robot's acceleration.
    """

    force: Newtons = 1.0
    speed: MetresPerSecond = 0.2


Move = Stay | Travel | Press | Slide | Retreat | Tap


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A stretch of a motion: rest, travel, approach, press, settle, hold, slide, release, retreat or tap."""

    kind: str
    start: Seconds
    stop: Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A whole motion over one string: `keys` for the twin, and the `phases` that they make up."""

    string: StringParams
    keys: tuple[Key, ...]
    phases: tuple[Phase, ...]

    @property
    def end(self) -> Seconds:
        """When the last move is over, in s."""
        return self.keys[-1].time

    @property
    def taps(self) -> tuple[Seconds, ...]:
        """When the tool is deepest in each tap, in s."""
        return tuple(0.5 * (p.start + p.stop) for p in self.phases if p.kind == "tap")

    def path(self, time: Floats) -> Floats:
        """Return where the tool is at times (n,) in s: x, y, z in m, (n, 3)."""
        keys = self._table()
        at = np.clip(time, keys[0, 0], keys[-1, 0])
        x, force, clearance = (np.interp(at, keys[:, 0], keys[:, column]) for column in (1, 2, 3))
        step = np.diff(keys[:, 0])
        gone = np.concatenate([[0.0], np.cumsum(step * 0.5 * (keys[1:, 4] + keys[:-1, 4]))])
        i = np.clip(np.searchsorted(keys[:, 0], at, side="right") - 1, 0, len(step) - 1)
        past = at - keys[i, 0]
        y = gone[i] + past * (keys[i, 4] + 0.5 * past * (keys[i + 1, 4] - keys[i, 4]) / step[i])
        return np.stack([x, y, clearance - depth_under(self.string, x, force)], axis=1)

    def lifted(self, offset: Metres) -> "Motion":
        """Return the same motion `offset` higher, in which the tool never meets the string, taps excepted.

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

    def _table(self) -> Floats:
        return np.array([[k.time, k.position, k.force, k.clearance, k.across] for k in self.keys])


@dataclass(frozen=True, slots=True, kw_only=True)
class _At:
    """Where the tool is between two moves; it rests there. `height` is negative where it presses."""

    time: Seconds
    x: Metres
    y: Metres
    height: Metres

    def key(self, string: StringParams) -> Key:
        return _key(string, self.time, self.x, self.height)


Step = tuple[_At, tuple[Key, ...], tuple[Phase, ...]]


def motion(moves: Iterable[Move], string: StringParams, *, position: Metres, begin: Seconds = 0.0) -> Motion:
    """Return the motion that moves make up, from `begin` on, the tool at rest above `position`.

    Parameters
    ----------
    moves
        What to do, one after the other.
    string
        What is pressed; it turns depths into forces.
    position
        Where the tool is at first, x in m, at `HEIGHT`.
    begin
        When the first move begins, in s.

    Returns
    -------
    Motion
        Keys in rising times, with the phases between them.

    Raises
    ------
    InputError
        For a move that cannot be, such as a slide in no direction or a press without an end.

    Examples
    --------
    >>> plain = StringParams(length=0.2, linear_density=4.0e-4, tension=65.0, core_diameter=2.54e-4)
    >>> done = motion([Press(force=1.0), Stay(seconds=0.5), Retreat()], plain, position=0.1)
    >>> [phase.kind for phase in done.phases]
    ['approach', 'press', 'hold', 'release', 'retreat']
    >>> float(done.path(np.array([done.phases[2].start]))[0, 2].round(6))
    -0.000766
    """
    at = _At(time=begin, x=position, y=0.0, height=HEIGHT)
    keys, phases = [at.key(string)], list[Phase]()
    for move in moves:
        at, more, passed = _done(move, at, string)
        keys += more
        phases += passed
    return Motion(string=string, keys=tuple(keys), phases=tuple(phases))


def _done(move: Move, at: _At, string: StringParams) -> Step:
    """Return where a move ends, its keys after the first, and its phases."""
    if isinstance(move, Press | Retreat | Tap):
        return _upright(move, at, string)
    if isinstance(move, Stay):
        if move.seconds <= 0.0:
            raise InputError(f"{move.kind} of {move.seconds:g} s", "more than 0 s")
        to = replace(at, time=at.time + move.seconds)
        return to, (to.key(string),), (Phase(kind=move.kind, start=at.time, stop=to.time),)
    if isinstance(move, Travel):
        if at.height <= 0.0:
            raise InputError("travel while pressing", "travel in the air", "retreat first")
        return _aside(at, move.position - at.x, -at.y, move.speed, "travel", string)
    if move.along == move.across == 0.0:
        raise InputError("slide by 0 m", "a way along or across the string")
    return _aside(at, move.along, move.across, move.speed, "slide", string)


def _upright(move: Press | Retreat | Tap, at: _At, string: StringParams) -> Step:
    if isinstance(move, Tap):
        return _tapped(at, move.force, move.speed, string)
    if isinstance(move, Retreat):
        return _lowered(at, move.height, move.speed, string, "retreat", "release")
    if (move.depth is None) == (move.force is None):
        raise InputError(f"press to depth {move.depth}, force {move.force}", "one of the two")
    depth = float(depth_under(string, at.x, move.force or 0.0)) if move.depth is None else move.depth
    if depth <= 0.0:
        raise InputError(f"press to a depth of {depth:g} m", "more than 0 m")
    return _lowered(at, -depth, move.speed, string, "approach", "press")


def _aside(
    at: _At, along: Metres, across: Metres, speed: MetresPerSecond, kind: str, string: StringParams
) -> Step:
    """Move in the plane, as straight as a glide is."""
    far = hypot(along, across)
    if far == 0.0:
        return at, (), ()
    keys: list[Key] = []
    for time, way, pace in glide(far, speed):
        share = way / far
        keys.append(_key(string, at.time + time, at.x + share * along, at.height, pace * across / far))
    to = replace(at, time=keys[-1].time, x=at.x + along, y=at.y + across)
    return to, tuple(keys), (Phase(kind=kind, start=at.time, stop=to.time),)


def _lowered(
    at: _At, height: Metres, speed: MetresPerSecond, string: StringParams, air: str, pressed: str
) -> Step:
    """Move up or down to a height; a key stands where the tool meets the string."""
    if height == at.height:
        return at, (), ()
    down = 1.0 if height > at.height else -1.0
    keys = list[Key]()
    meets: Seconds | None = None
    before, last = at.height, at.time
    for time, way, _ in glide(abs(height - at.height), speed):
        now = at.height + down * way
        if before * now < 0.0:
            share = before / (before - now)
            meets = last + share * (at.time + time - last)
            keys.append(_key(string, meets, at.x, 0.0))
        before, last = now, at.time + time
        keys.append(_key(string, last, at.x, now))
    to = replace(at, time=last, height=height)
    first, second = (air, pressed) if down < 0.0 else (pressed, air)
    if meets is None:
        only = pressed if min(at.height, height) < 0.0 else air
        return to, tuple(keys), (Phase(kind=only, start=at.time, stop=to.time),)
    halves = Phase(kind=first, start=at.time, stop=meets), Phase(kind=second, start=meets, stop=to.time)
    return to, tuple(keys), halves


def _tapped(at: _At, force: Newtons, speed: MetresPerSecond, string: StringParams) -> Step:
    if at.height <= 0.0:
        raise InputError("tap while pressing", "tap from the air", "retreat first")
    depth = float(depth_under(string, at.x, force))
    fall, sink = at.height / speed, depth / speed
    points = ((fall, 0.0), (fall + sink, -depth), (fall + 2.0 * sink, 0.0), (2.0 * (fall + sink), at.height))
    keys = tuple(_key(string, at.time + time, at.x, height) for time, height in points)
    to = replace(at, time=keys[-1].time)
    return to, keys, (Phase(kind="tap", start=at.time, stop=to.time),)


def _key(
    string: StringParams, time: Seconds, x: Metres, height: Metres, across: MetresPerSecond = 0.0
) -> Key:
    force = float(force_at_depth(string, x, -height)) if height < 0.0 else 0.0
    return Key(time=time, position=x, force=force, clearance=max(0.0, height), across=across)
