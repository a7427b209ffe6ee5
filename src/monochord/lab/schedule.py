"""The schedule of a session: taps, drivers on, the protocol's touches, drivers off, and taps again."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import cycle, islice
from math import cos, pi

import numpy as np

from monochord.core.types import Floats, StringParams
from monochord.core.units import Hertz, Metres, MetresPerSecond, Newtons, Seconds
from monochord.lab.assignment import Assignment
from monochord.lab.plan import drawn
from monochord.physics.twin.trajectory import (
    Approach,
    Hop,
    Load,
    Move,
    Press,
    Retreat,
    Slide,
    Stay,
    Sway,
    Tap,
    Trajectory,
    Travel,
    depth_under,
    trajectory,
)  # fmt: skip

PAUSES = (0.24, 0.31)
"""Pauses between taps in s: unequal, so that neighbouring taps cannot be confused."""
BEFORE: Seconds = 0.4
AFTER: Seconds = 0.15
"""Pauses before the first and after the last of three taps, in s."""
SETTLING: Seconds = 1.2
"""Time for the string's sound to build up after the drivers are switched on, in s."""
MIN_ON: Seconds = 0.5
"""Shortest time that the drivers are on, in s."""
PRESSES = ("press", "touch")
"""Phases in which a tool meets the string."""
FADING: Seconds = 0.7
"""Time for the string to fall silent after the drivers are switched off, in s."""
SETTLE: Seconds = 0.2
"""Time from the end of a press until the sound has mostly settled, in s."""
REST: Seconds = 0.1
"""Time in the air after a touch, in s."""
OBLIQUE_SPEED: MetresPerSecond = 0.01
"""Sideways speed of an oblique press, in m/s."""
TURN: Seconds = 0.1
"""Time between two strokes, in s."""
HAND_SPEED = (0.05, 0.2)
"""Range of a hand's approach speed, in m/s: a robot's, and four times as fast. Assumed."""
HAND_BESIDE = (1e-3, 5e-3)
"""Range of the distance in m at which a hand may land beside its position, then slide there. Assumed."""
HAND_SLIDE: MetresPerSecond = 0.03
"""Speed at which it slides there, in m/s."""
HAND_STEP: Seconds = 0.03
"""Pause between the steps of a hand's press, in s: with its motion, some 20 steps a second."""
HAND_STEPS = (0.3, 0.6, 0.8, 1.0)
"""Shares of the depth of these steps, after one of a tenth."""
HAND_WAVER = 0.03
"""Relative standard deviation of a hand's depth, drawn anew every `HAND_HOLD`: a steady finger's. Assumed."""
HAND_HOLD: Seconds = 0.15
BRUSH = (0.08, 0.35)
"""Shortest and longest brief touch, and pause after it, in s."""
TAP_SPEED = (0.03, 0.3)
"""Range of the speed of a tap of the protocol "tap" in m/s: assumed."""
SWING_SHARE = (0.25, 0.75)
"""Range of how far apart the two forces of a swing are, as a share of the group's range of forces."""
SMOOTH_SHARE = (0.05, 0.75)
"""That of a smooth swing."""
SMOOTH_POINTS = 8
"""Straight segments of half a period of a smooth swing."""
FIRST_SHARE = 0.04
"""Share of its force with which a press that takes its time meets the string."""
RISE_SHARE = (0.1, 0.9)
"""Range of how much of the time between two commands a step of the force takes."""
VIBRATO_RATES: tuple[Hertz, Hertz] = (3.0, 7.0)
"""Range of the rate of a vibrato, from a slow swing to a violinist's."""
ELSEWHERE = 0.5
"""Share of the presses of `again` that are at another place."""
HOP_SPEED: MetresPerSecond = 4.0
"""Highest speed of a hop along the string in m/s: below the twin's limit of 5."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """A session's motion, and the time its drivers are on: from `on` to `off`, in s.

    `death` has the time at which one of them stops for good, and its number, 1 or 2.
    """

    motion: Trajectory
    on: Seconds
    off: Seconds
    death: tuple[Seconds, int] | None = None

    @property
    def taps(self) -> tuple[Seconds, ...]:
        """Times of the deepest point of each tap, in s."""
        return self.motion.taps


def schedule(session: Assignment) -> Schedule:
    """Return the schedule of a session; it depends only on the assignment.

    >>> from monochord.lab.plans import load_plan
    >>> from monochord.lab import assignments
    >>> timing = schedule(assignments(load_plan("small"))[0])
    >>> len(timing.taps), timing.taps[2] < timing.on < timing.off < timing.taps[3]
    (6, True)
    """
    design, sensor = session.design(), session.sensor()
    middle = 0.5 * (design.range[0] + design.range[1])
    string = replace(sensor.string, tension=sensor.string.tension + sensor.drift)
    first = [Stay(seconds=BEFORE, kind="rest"), *_taps(), Stay(seconds=AFTER, kind="rest")]
    on = trajectory(first, string, position=middle).end
    group, random = session.group, session.random("drivers")
    settling = [Stay(seconds=SETTLING, kind="rest")] if group.on_touched is None else []
    inner = [*settling, *_Touches(session, design.string).moves(), Travel(position=middle)]
    off = trajectory([*first, *inner], string, position=middle).end
    last = [Stay(seconds=FADING, kind="rest"), *_taps(), Stay(seconds=BEFORE, kind="rest")]
    whole = trajectory([*first, *inner, *last], string, position=middle)
    if group.on_touched is not None:
        contact = next(phase.start for phase in whole.phases if phase.kind in PRESSES and phase.start >= on)
        on = min(max(on, contact + float(random.uniform(*group.on_touched))), off - MIN_ON)
    death: tuple[Seconds, int] | None = None
    if group.driver_dies is not None:
        share, driver = float(random.uniform(*group.driver_dies)), int(random.integers(1, 3))
        death = on + share * (off - on), driver
    whole = whole.lifted(group.lifted) if group.lifted > 0.0 else whole
    return Schedule(motion=whole, on=on, off=off, death=death)


def _taps() -> Iterator[Move]:
    yield Tap()
    for pause in PAUSES:
        yield Stay(seconds=pause, kind="rest")
        yield Tap()


class _Touches:
    """The touches of a session, as moves; depths follow from the grid's forces and the nominal string."""

    def __init__(self, session: Assignment, design: StringParams) -> None:
        origin = session.origin
        self._session, self._group, self._string = session, origin.group, design
        self._places = origin.group.places or session.design().range
        self._random, self._pace = origin.random("touches"), origin.random("pace")

    def moves(self) -> Iterator[Move]:
        """Yield the moves of every touch, and of the pause after it."""
        group = self._group
        for number, (place, force) in enumerate(self._session.cells().tolist()):
            if group.approach == "hand":
                yield from self._by_hand(place, force)
            elif group.protocol == "hover":
                yield Travel(position=place)
                yield Approach(height=self._random.uniform(*group.clearances))
                yield Stay(seconds=drawn(group.hold, self._pace), kind="hover")
                yield Retreat()
            elif group.protocol == "tap":
                yield Travel(position=place)
                contact = drawn(group.hold, self._pace)
                yield Tap(force=force, speed=drawn(TAP_SPEED, self._pace), contact=contact, kind="touch")
            else:
                yield from self._by_robot(place, force, number)
            pause = self._random.uniform(*BRUSH) if group.protocol == "brush" else REST
            yield Stay(seconds=pause if group.pause is None else drawn(group.pause, self._pace), kind="rest")

    def _by_robot(self, place: Metres, force: Newtons, number: int) -> Iterator[Move]:
        """Yield a touch that comes straight down, is held or led along or across, and goes."""
        group, random = self._group, self._random
        amplitude = 0.0
        if group.vibrato is not None:
            low, high = self._places
            amplitude = min(drawn(group.vibrato, self._pace), 0.5 * (high - low))
            place = min(max(place, low + amplitude), high - amplitude)
        depth = self._depth(place, force)
        yield Travel(position=place)
        if group.rise is None:
            yield Press(depth=depth)
        else:
            yield Press(force=FIRST_SHARE * force)
            yield Load(force=force, seconds=drawn(group.rise, self._pace), kind="press")
        if group.oblique[1] > 0.0:
            sideways = random.choice((-1.0, 1.0)) * random.uniform(*group.oblique) * depth
            yield Slide(across=sideways, speed=OBLIQUE_SPEED)
        if group.protocol == "brush":
            yield Stay(seconds=random.uniform(*BRUSH), kind="hold")
            yield Retreat(speed=random.uniform(0.02, 0.1))
            return
        yield Stay(seconds=SETTLE, kind="settle")
        if group.protocol == "slide":
            yield from self._strokes(place, random.uniform(size=(group.strokes, 2)), number)
        else:
            yield from self._held(force, amplitude)
            if group.again is not None:
                yield from self._again(place, force)
        yield Retreat()

    def _held(self, force: Newtons, amplitude: Metres) -> Iterator[Move]:
        """Hold a touch: still, with a force that swings, or with a place that does."""
        group, pace = self._group, self._pace
        seconds = drawn(group.hold, pace)
        if amplitude > 0.0:
            yield Sway(amplitude=amplitude, rate=drawn(VIBRATO_RATES, pace), seconds=seconds)
        elif group.swing is None:
            yield self._at_rest(seconds)
        else:
            low, high = group.forces
            share = float(pace.uniform(*(SMOOTH_SHARE if group.smooth else SWING_SHARE)))
            other = low + (force - low + share * (high - low)) % (high - low)
            leg = abs(other - force) / drawn(group.swing, pace)
            for first, last in islice(cycle(((force, other), (other, force))), max(1, round(seconds / leg))):
                yield from self._loaded(first, last, leg)

    def _at_rest(self, seconds: Seconds) -> Move:
        """Hold still, or nearly so."""
        if self._group.creep is None:
            return Stay(seconds=seconds, kind="hold")
        speed = drawn(self._group.creep, self._pace)
        way = float(self._pace.choice((-1.0, 1.0)))
        return Slide(across=way * speed * seconds, speed=speed, kind="hold")

    def _loaded(self, first: Newtons, last: Newtons, seconds: Seconds) -> Iterator[Move]:
        """Lead the force from one to another: evenly, as a sine does, or by a controller's steps."""
        if self._group.smooth:
            for point in range(1, SMOOTH_POINTS + 1):
                share = 0.5 * (1.0 - cos(pi * point / SMOOTH_POINTS))
                yield Load(force=first + share * (last - first), seconds=seconds / SMOOTH_POINTS)
            return
        if self._group.steps is None:
            yield Load(force=last, seconds=seconds)
            return
        count = max(1, round(seconds / drawn(self._group.steps, self._pace)))
        rise = seconds / count * float(self._pace.uniform(*RISE_SHARE))
        for force in np.linspace(first, last, count + 1)[1:].tolist():
            yield Load(force=force, seconds=rise)
            yield Stay(seconds=seconds / count - rise, kind="hold")

    def _again(self, place: Metres, force: Newtons) -> Iterator[Move]:
        """Release, and press again soon: at the same place, or at another one."""
        group, pace = self._group, self._pace
        seconds = drawn(group.again or REST, pace)
        if pace.uniform() < ELSEWHERE:
            reach = 0.5 * seconds * HOP_SPEED
            other = float(pace.uniform(*self._places))
            place = min(max(other, place - reach), place + reach)
        yield Hop(position=place, depth=self._depth(place, force), seconds=seconds)
        yield Stay(seconds=drawn(group.hold, pace), kind="hold")

    def _by_hand(self, place: Metres, force: Newtons) -> Iterator[Move]:
        """Yield a touch by hand: straight down, in steps, or led from beside its place; then it wavers."""
        random, depth = self._random, self._depth(place, force)
        way, speed = int(random.integers(3)), float(random.uniform(*HAND_SPEED))
        if way == 2:
            low, high = self._places
            beside = float(random.uniform(*HAND_BESIDE)) * (1.0 if place < 0.5 * (low + high) else -1.0)
            yield Travel(position=place + beside)
            yield Press(depth=self._depth(place + beside, force), speed=speed)
            yield Slide(along=-beside, speed=HAND_SLIDE)
        else:
            yield Travel(position=place)
            for share in (0.1, *HAND_STEPS) if way == 1 else ():
                yield Press(depth=share * depth, speed=speed)
                yield Stay(seconds=HAND_STEP, kind="press")
            if way == 0:
                yield Press(depth=depth, speed=speed)
        yield Stay(seconds=SETTLE, kind="settle")
        for _ in range(max(1, round(drawn(self._group.hold, self._pace) / HAND_HOLD))):
            waver = float(np.clip(random.normal(), -2.0, 2.0)) * HAND_WAVER
            yield Press(depth=(1.0 + waver) * depth, speed=HAND_SLIDE)
            yield Stay(seconds=HAND_HOLD, kind="hold")
        yield Retreat(speed=speed)

    def _strokes(self, place: Metres, shares: Floats, number: int) -> Iterator[Move]:
        """Move back and forth: along the string in every second touch and across it in the others.

        A rolling object moves along the string only: across it, it would slide.
        """
        group, (low, high) = self._group, self._places
        forces, speeds = group.forces, group.speeds
        for i, (speed_share, force_share) in enumerate(shares.tolist()):
            if i > 0:
                yield Press(depth=self._depth(place, forces[0] + force_share * (forces[1] - forces[0])))
                yield Stay(seconds=TURN, kind="hold")
            speed = speeds[0] + (i + speed_share) / len(shares) * (speeds[1] - speeds[0])
            distance = speed * drawn(group.hold, self._pace)
            if number % 2 == 0 and not group.rolls:
                yield Slide(across=distance if i % 2 == 0 else -distance, speed=speed)
            else:
                space = high - place, place - low
                distance = min(distance, max(space))
                ahead = space[0] >= distance and (i % 2 == 0 or space[1] < distance)
                distance = distance if ahead else -distance
                yield Slide(along=distance, speed=speed)
                place += distance
            if group.dwell is not None:
                yield self._at_rest(drawn(group.dwell, self._pace))

    def _depth(self, place: Metres, force: Newtons) -> Metres:
        return float(depth_under(self._string, place, force))
