"""The schedule of a session: taps, drivers on, the protocol's touches, drivers off, and taps again."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

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
