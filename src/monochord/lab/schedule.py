"""The schedule of a session: taps, drivers on, the protocol's touches, drivers off, and taps again."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from monochord.core.types import Floats, StringParams
from monochord.core.units import Metres, MetresPerSecond, Seconds
from monochord.lab.plan import Assignment
from monochord.physics.twin.trajectory import (
    Approach,
    Move,
    Press,
    Retreat,
    Slide,
    Stay,
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """A session's motion, and the time its drivers are on: from `on` to `off`, in s."""

    motion: Trajectory
    on: Seconds
    off: Seconds

    @property
    def taps(self) -> tuple[Seconds, ...]:
        """Times of the deepest point of each tap, in s."""
        return self.motion.taps


def schedule(session: Assignment) -> Schedule:
    """Return the schedule of a session; it depends only on the assignment.

    Examples
    --------
    >>> from monochord.lab.plans import load_plan
    >>> from monochord.lab.plan import assignments
    >>> timing = schedule(assignments(load_plan("small"))[0])
    >>> len(timing.taps), timing.taps[2] < timing.on < timing.off < timing.taps[3]
    (6, True)
    """
    design, sensor = session.design(), session.sensor()
    middle = 0.5 * (design.range[0] + design.range[1])
    string = replace(sensor.string, tension=sensor.string.tension + sensor.drift)
    first = [Stay(seconds=BEFORE, kind="rest"), *_taps(), Stay(seconds=AFTER, kind="rest")]
    on = trajectory(first, string, position=middle).end
    inner = [Stay(seconds=SETTLING, kind="rest"), *_touches(session, design.string), Travel(position=middle)]
    off = trajectory([*first, *inner], string, position=middle).end
    last = [Stay(seconds=FADING, kind="rest"), *_taps(), Stay(seconds=BEFORE, kind="rest")]
    whole = trajectory([*first, *inner, *last], string, position=middle)
    whole = whole.lifted(session.group.lifted) if session.group.lifted > 0.0 else whole
    return Schedule(motion=whole, on=on, off=off)


def _taps() -> Iterator[Move]:
    yield Tap()
    for pause in PAUSES:
        yield Stay(seconds=pause, kind="rest")
        yield Tap()


def _touches(session: Assignment, design: StringParams) -> Iterator[Move]:
    """Yield the moves of every touch; depths follow from the grid's forces and the nominal string."""
    group, random = session.origin.group, session.origin.random("touches")
    for number, (place, force) in enumerate(session.cells().tolist()):
        if group.approach == "hand":
            yield from _by_hand(session, design, place, force, random)
            continue
        yield Travel(position=place)
        if group.protocol == "hover":
            yield Approach(height=random.uniform(*group.clearances))
            yield Stay(seconds=group.hold, kind="hover")
            yield Retreat()
            yield Stay(seconds=REST, kind="rest")
            continue
        depth = _depth(design, place, force)
        yield Press(depth=depth)
        if group.oblique[1] > 0.0:
            sideways = random.choice((-1.0, 1.0)) * random.uniform(*group.oblique) * depth
            yield Slide(across=sideways, speed=OBLIQUE_SPEED)
        if group.protocol == "brush":
            yield Stay(seconds=random.uniform(*BRUSH), kind="hold")
            yield Retreat(speed=random.uniform(0.02, 0.1))
            yield Stay(seconds=random.uniform(*BRUSH), kind="rest")
            continue
        yield Stay(seconds=SETTLE, kind="settle")
        if group.protocol == "hold":
            yield Stay(seconds=group.hold, kind="hold")
        else:
            yield from _strokes(session, design, place, random.uniform(size=(group.strokes, 2)), number)
        yield Retreat()
        yield Stay(seconds=REST, kind="rest")


def _by_hand(
    session: Assignment, design: StringParams, place: Metres, force: float, random: np.random.Generator
) -> Iterator[Move]:
    """Yield a touch by hand: straight down, in steps, or beside its place and led there; then it wavers."""
    depth, way = _depth(design, place, force), int(random.integers(3))
    speed = float(random.uniform(*HAND_SPEED))
    if way == 2:
        low, high = session.group.places or session.design().range
        beside = float(random.uniform(*HAND_BESIDE)) * (1.0 if place < 0.5 * (low + high) else -1.0)
        yield Travel(position=place + beside)
        yield Press(depth=_depth(design, place + beside, force), speed=speed)
        yield Slide(along=-beside, speed=HAND_SLIDE)
    else:
        yield Travel(position=place)
        for share in (0.1, *HAND_STEPS) if way == 1 else ():
            yield Press(depth=share * depth, speed=speed)
            yield Stay(seconds=HAND_STEP, kind="press")
        if way == 0:
            yield Press(depth=depth, speed=speed)
    yield Stay(seconds=SETTLE, kind="settle")
    for _ in range(max(1, round(session.group.hold / HAND_HOLD))):
        waver = float(np.clip(random.normal(), -2.0, 2.0)) * HAND_WAVER
        yield Press(depth=(1.0 + waver) * depth, speed=HAND_SLIDE)
        yield Stay(seconds=HAND_HOLD, kind="hold")
    yield Retreat(speed=speed)
    yield Stay(seconds=REST, kind="rest")


def _strokes(
    session: Assignment, design: StringParams, place: Metres, drawn: Floats, number: int
) -> Iterator[Move]:
    """Move back and forth: along the string in every second touch and across it in the others.

    A rolling object moves along the string only: across it, it would slide.
    """
    group = session.origin.group
    low, high = group.places or session.design().range
    forces, speeds = group.forces, group.speeds
    for i, (speed_share, force_share) in enumerate(drawn.tolist()):
        if i > 0:
            yield Press(depth=_depth(design, place, forces[0] + force_share * (forces[1] - forces[0])))
            yield Stay(seconds=TURN, kind="hold")
        speed = speeds[0] + (i + speed_share) / len(drawn) * (speeds[1] - speeds[0])
        distance = speed * group.hold
        if number % 2 == 0 and not group.rolls:
            yield Slide(across=distance if i % 2 == 0 else -distance, speed=speed)
            continue
        space = high - place, place - low
        distance = min(distance, max(space))
        distance = distance if space[0] >= distance and (i % 2 == 0 or space[1] < distance) else -distance
        yield Slide(along=distance, speed=speed)
        place += distance


def _depth(design: StringParams, place: Metres, force: float) -> Metres:
    return float(depth_under(design, place, force))
