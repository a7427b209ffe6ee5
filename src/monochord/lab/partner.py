"""A second object beside the first: where it presses, how hard, and when it comes and goes."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from monochord.core.units import Metres, Newtons, Seconds
from monochord.lab.assignment import Assignment
from monochord.lab.objects import evenly
from monochord.lab.plan import MAX_FORCE
from monochord.physics.twin import Key
from monochord.physics.twin.trajectory import Trajectory

NEAREST_END = 0.03
"""Smallest distance of a second object from either end, as a share of the string's length."""
SHARES = (0.5, 2.0)
"""Range of its force relative to the first object's, where a range draws its distance. Assumed."""
EDGE: Seconds = 0.05
"""Time after its first and before its last contact that moves with it, so that a press keeps its speed."""


def partner_keys(session: Assignment, motion: Trajectory, length: Metres) -> tuple[Key, ...]:
    """Return the motion of a session's second object on a string of a length in m; none where it has none.

    It is the first object's motion moved along the string. With a range of distances, each touch has its own
    distance, direction and force, and comes and goes by the session's `in_turn` beside the first.

    >>> from monochord.lab import Group, Plan, assignments
    >>> from monochord.lab.schedule import schedule
    >>> session = assignments(Plan(name="p", groups=(Group(name="a", grid=(1, 1), second=0.02),)))[0]
    >>> motion = schedule(session).motion
    >>> moved = partner_keys(session, motion, 0.2)
    >>> abs(round(moved[-1].position - motion.keys[-1].position, 6))
    0.02
    """
    second, ends = session.group.second, (NEAREST_END * length, (1.0 - NEAREST_END) * length)
    if not isinstance(second, tuple):
        places = [key.position for key in motion.keys]
        away = second if length - max(places) > min(places) else -second
        return tuple(_moved(key, away, ends) for key in motion.keys) if second > 0.0 else ()
    touches = _touches(session, motion, ends)
    time = np.array([key.time for key in motion.keys])
    knots = np.array([t for touch in touches for t in touch.times])
    later = np.interp(time, knots, [t for touch in touches for t in touch.later])
    away = np.interp(time, knots, np.repeat([touch.away for touch in touches], 4))
    share = np.interp(time, knots, np.repeat([touch.share for touch in touches], 4))
    return tuple(
        replace(_moved(key, float(d), ends, float(s)), time=float(key.time + t))
        for key, t, d, s in zip(motion.keys, later, away, share, strict=True)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _PartnerTouch:
    """A touch of the second object: times of the first one's, how much later, how far away, how hard."""

    times: tuple[Seconds, ...]
    later: tuple[Seconds, ...]
    away: Metres
    share: float


def _touches(session: Assignment, motion: Trajectory, ends: tuple[Metres, Metres]) -> list[_PartnerTouch]:
    """Return every stretch in which the first object presses, with what is drawn for the second."""
    random, group = session.random("second"), session.group
    distances = group.second if isinstance(group.second, tuple) else (group.second, group.second)
    taps = [(phase.start, phase.stop) for phase in motion.phases if phase.kind == "tap"]
    touches = list[_PartnerTouch]()
    for pressed in _pressed(motion.keys):
        begin, end = pressed[0].time, pressed[-1].time
        edge = min(EDGE, 0.25 * (end - begin))
        places = [key.position for key in pressed]
        distance = evenly(random)(*distances)
        space = ends[1] - max(places), min(places) - ends[0]
        fits = [away for away, free in zip((distance, -distance), space, strict=True) if free >= distance]
        widest = distance if space[0] > space[1] else -distance
        away = float(random.choice(fits)) if fits else widest
        come = go = 0.0
        if group.in_turn is not None and not any(start <= begin <= stop for start, stop in taps):
            come = float(random.uniform(*group.in_turn))
            go = float(random.choice((-1.0, 1.0)) * random.uniform(*group.in_turn))
        touches.append(
            _PartnerTouch(
                times=(begin, begin + edge, end - edge, end),
                later=(come, come, go, go),
                away=away,
                share=evenly(random)(*SHARES),
            )
        )
    return touches


def _pressed(keys: tuple[Key, ...]) -> list[list[Key]]:
    """Return each run of keys that press, with the keys before and after it, at which it does not yet."""
    runs, run = list[list[Key]](), list[Key]()
    for before, key in pairwise(keys):
        if key.force > 0.0:
            run = [*(run or [before]), key]
        elif run:
            runs.append([*run, key])
            run = []
    return runs


def _moved(key: Key, away: Metres, ends: tuple[Metres, Metres], share: float = 1.0) -> Key:
    force: Newtons = key.force if share == 1.0 else min(share * key.force, MAX_FORCE)
    return replace(key, position=min(max(key.position + away, ends[0]), ends[1]), force=force)
