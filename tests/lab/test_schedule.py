from dataclasses import replace

import numpy as np
import pytest
from tests.lab.tiny import session, tiny

from monochord.core.errors import InputError
from monochord.lab.assignment import assignments
from monochord.lab.plan import Group
from monochord.lab.schedule import PAUSES, schedule
from monochord.physics.twin.trajectory import depth_under


def kinds(name: str) -> list[str]:
    timing = schedule(session(name))
    return [phase.kind for phase in timing.motion.phases if timing.on < phase.start < timing.off - 1e-9]


def test_a_session_begins_and_ends_with_three_unequal_taps_in_silence() -> None:
    timing = schedule(session("hold_000"))
    first, last = np.array(timing.taps).reshape(2, 3)
    steps = np.diff(first)
    np.testing.assert_allclose(steps, np.diff(last))
    assert abs(steps[0] - steps[1]) > 0.05
    np.testing.assert_allclose(steps - PAUSES, steps[0] - PAUSES[0])
    assert first[-1] + 0.1 < timing.on < timing.off < last[0] - 0.5
    assert timing.motion.end > last[-1] + 0.3


def test_holds_press_settle_and_hold() -> None:
    touch = ["travel", "approach", "press", "settle", "hold", "release", "retreat", "rest"]
    assert kinds("hold_000") == [*touch, *touch, "travel"]


def test_slides_go_across_in_one_touch_and_along_in_the_next() -> None:
    timing = schedule(session("slide_000")).motion
    slides = [phase for phase in timing.phases if phase.kind == "slide"]
    ends = timing.path(np.array([[phase.start, phase.stop] for phase in slides]).ravel()).reshape(-1, 2, 3)
    moved = ends[:, 1] - ends[:, 0]
    assert (np.abs(moved[:2, 1]) > 4e-3).all()
    assert np.abs(moved[:2, 0]).max() < 1e-12
    assert (np.abs(moved[2:, 0]) > 4e-3).all()
    assert np.abs(moved[2:, 1]).max() < 1e-12
    assert moved[0, 1] * moved[1, 1] < 0.0


def test_what_rolls_moves_along_the_string_alone() -> None:
    group = Group(name="roll", protocol="slide", grid=(2, 1), strokes=2, rolls=True)
    path = schedule(session("roll_000", tiny(groups=(group,)))).motion
    slides = [phase for phase in path.phases if phase.kind == "slide"]
    ends = path.path(np.array([[phase.start, phase.stop] for phase in slides]).ravel()).reshape(-1, 2, 3)
    moved = ends[:, 1] - ends[:, 0]
    assert len(moved) == 4
    assert (np.abs(moved[:, 0]) > 5e-4).all()
    assert np.abs(moved[:, 1]).max() < 1e-12


def test_slides_along_stay_on_the_range() -> None:
    fast = Group(name="fast", protocol="slide", grid=(6, 1), hold=3.0, speeds=(0.03, 0.03))
    path = schedule(session("fast_000", tiny(groups=(fast,)))).motion
    x = path.path(np.arange(0.0, path.end, 0.01))[:, 0]
    assert x.min() >= 0.05 - 1e-9
    assert x.max() <= 0.15 + 1e-9


def test_brief_touches_come_and_go() -> None:
    brush = Group(name="brush", protocol="brush", grid=(4, 3))
    timing = schedule(session("brush_000", tiny(groups=(brush,))))
    holds = [phase.stop - phase.start for phase in timing.motion.phases if phase.kind == "hold"]
    assert len(holds) == 12
    assert 0.08 <= min(holds) < max(holds) <= 0.35


def test_a_lifted_session_touches_in_its_taps_only() -> None:
    group = Group(name="hold", grid=(2, 1))
    lifted = Group(name="clear", like="hold", lifted=3e-3)
    plan = tiny(groups=(group, lifted))
    timing, low = schedule(session("clear_000", plan)), schedule(session("hold_000", plan))
    assert max(key.force for key in timing.motion.keys if timing.on < key.time < timing.off) == 0.0
    assert max(key.force for key in low.motion.keys if low.on < key.time < low.off) > 0.0
    assert timing.taps == low.taps


def test_a_hand_comes_down_in_three_ways_and_wavers_where_the_robot_would_stand() -> None:
    group = Group(name="a", grid=(12, 2), places=(0.01, 0.19), forces=(0.3, 1.5), hold=1.0)
    robot, hand = (assignments(tiny(groups=(replace(group, approach=way),)))[0] for way in ("robot", "hand"))
    np.testing.assert_array_equal(robot.cells(), hand.cells())
    motion = schedule(hand).motion
    kinds = [phase.kind for phase in motion.phases]
    assert 2 <= kinds.count("slide") <= 16  # led to the place from beside it
    held = [phase for phase in motion.phases if phase.kind == "hold"]
    places = motion.path(np.array([phase.start for phase in held]))
    assert len(held) == 7 * len(hand.cells())  # a second, in pieces of 0.15 s
    for i, (place, force) in enumerate(hand.cells().tolist()):
        own = places[7 * i : 7 * i + 7]
        depth = depth_under(hand.design().string, place, force)
        np.testing.assert_allclose(own[:, 0], place, atol=1e-9)
        np.testing.assert_allclose(-own[:, 2], depth, rtol=0.061)
        assert np.ptp(own[:, 2]) > 1e-3 * depth


def test_a_hand_that_slides_is_refused() -> None:
    with pytest.raises(InputError, match="hand"):
        Group(name="a", protocol="slide", approach="hand")
