from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.lab.motion import HEIGHT, Motion, Move, Press, Retreat, Slide, Stay, Tap, Travel, motion
from monochord.lab.pressing import depth_under, force_at_depth
from monochord.physics.sensors import load_sensor

STRING = load_sensor("prototype").string
EVERYTHING: list[Move] = [
    Tap(),
    Travel(position=0.08),
    Press(force=1.0),
    Stay(seconds=0.3),
    Slide(along=0.02, speed=0.02),
    Slide(across=-0.015, speed=0.03),
    Press(depth=3e-4),
    Stay(seconds=0.2),
    Retreat(),
    Travel(position=0.1),
]


def go(*moves: Move) -> Motion:
    return motion(moves, STRING, position=0.1)


def test_phases_follow_each_other_and_times_rise() -> None:
    done = go(*EVERYTHING)
    kinds = [phase.kind for phase in done.phases]
    assert kinds == [
        "tap", "travel", "approach", "press", "hold", "slide", "slide", "press", "hold", "release", "retreat",
        "travel",
    ]  # fmt: skip
    assert all(a.stop == b.start for a, b in pairwise(done.phases))
    assert (np.diff([key.time for key in done.keys]) > 0.0).all()


def test_the_path_is_smooth_save_for_taps() -> None:
    done = go(*EVERYTHING[1:])
    time = np.arange(0.0, done.end, 1e-3)
    speed = np.diff(done.path(time), axis=0) / 1e-3
    assert np.abs(speed).max(axis=0) == pytest.approx([0.25, 0.25, 0.05], rel=0.6)
    assert np.abs(speed).max() <= 0.26
    jump = np.abs(np.diff(speed, axis=0)).max()  # slopes are cut into four: a jump is a quarter of 0.25 m/s
    assert jump < 0.07


def test_a_press_to_a_force_is_one_to_the_depth_of_that_force() -> None:
    depth = float(depth_under(STRING, 0.1, 1.3))
    by_force, by_depth = go(Press(force=1.3)), go(Press(depth=depth))
    for name in ("time", "force"):
        told = [[getattr(key, name) for key in one.keys] for one in (by_force, by_depth)]
        assert told[0] == pytest.approx(told[1])
    assert by_force.keys[-1].force == pytest.approx(1.3)
    assert by_force.path(np.array([by_force.end]))[0, 2] == pytest.approx(-depth)


def test_a_slide_along_keeps_its_depth_and_its_force_follows_the_string() -> None:
    done = go(Press(depth=6e-4), Slide(along=-0.05, speed=0.03))
    slide = done.phases[-1]
    at = done.path(np.linspace(slide.start, slide.stop, 200))
    np.testing.assert_allclose(at[:, 2], -6e-4, atol=2e-6)
    assert at[-1, 0] == pytest.approx(0.05)
    assert done.keys[-1].force == pytest.approx(float(force_at_depth(STRING, 0.05, 6e-4)))
    middle = done.path(np.array([0.5, 0.6]) * (slide.stop - slide.start) + slide.start)
    assert (middle[1, 0] - middle[0, 0]) / (0.1 * (slide.stop - slide.start)) == pytest.approx(-0.03)


def test_across_is_the_sum_of_the_speed_and_travel_brings_it_back() -> None:
    done = go(Press(force=1.0), Slide(across=0.02, speed=0.01), Slide(across=-0.005, speed=0.03), Retreat(),
              Travel(position=0.06))  # fmt: skip
    stops = [phase.stop for phase in done.phases if phase.kind in ("slide", "travel")]
    np.testing.assert_allclose(done.path(np.array(stops))[:, 1], [0.02, 0.015, 0.0], atol=1e-9)
    np.testing.assert_allclose(done.path(np.array([done.end]))[0, :2], [0.06, 0.0], atol=1e-9)
    assert max(abs(key.across) for key in done.keys if key.force > 0.0) == pytest.approx(0.03)


def test_a_tap_is_a_v_of_one_speed() -> None:
    done = go(Stay(seconds=0.1, kind="rest"), Tap(force=1.0, speed=0.2))
    (tap,) = done.taps
    depth = float(depth_under(STRING, 0.1, 1.0))
    assert tap == pytest.approx(0.1 + (HEIGHT + depth) / 0.2)
    time = np.array([tap - 0.01, tap - 0.001, tap, tap + 0.001, tap + 0.01])
    expected = -depth + 0.2 * np.abs(time - tap)
    np.testing.assert_allclose(done.path(time)[:, 2], expected, atol=1e-5)


def test_lifted_is_the_same_motion_without_contact() -> None:
    done = go(*EVERYTHING)
    aloft = done.lifted(2e-3)
    after_taps = [key for key in aloft.keys if key.time > done.phases[0].stop]
    assert all(key.force == 0.0 for key in after_taps)
    assert max(key.force for key in aloft.keys) == pytest.approx(1.0)  # the tap still touches
    time = np.linspace(done.phases[1].stop, done.end, 500)
    np.testing.assert_allclose(aloft.path(time), done.path(time) + np.array([0.0, 0.0, 2e-3]), atol=2e-5)
    with pytest.raises(InputError, match="clearance offset"):
        done.lifted(5e-4)


@pytest.mark.parametrize(
    ("moves", "line"),
    [
        ([Press()], "one of the two"),
        ([Press(force=1.0, depth=1e-3)], "one of the two"),
        ([Press(depth=-1e-3)], "more than 0 m"),
        ([Press(force=1.0), Travel(position=0.08)], "retreat first"),
        ([Press(force=1.0), Tap()], "retreat first"),
        ([Slide()], "slide by 0 m"),
        ([Stay(seconds=0.0)], "more than 0 s"),
        ([Slide(along=0.01, speed=0.0)], "more than 0"),
    ],
)
def test_moves_that_cannot_be_are_refused(moves: list[Move], line: str) -> None:
    with pytest.raises(InputError, match=line):
        go(*moves)


def test_the_string_as_it_is_turns_a_depth_into_another_force() -> None:
    tighter = replace(STRING, tension=1.01 * STRING.tension)
    press = [Press(depth=5e-4)]
    usual, tight = (motion(press, string, position=0.1).keys[-1].force for string in (STRING, tighter))
    assert tight == pytest.approx(1.01 * usual, rel=1e-3)
