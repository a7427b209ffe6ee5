"""Motions of a tool: phases, speeds within their limits, depth and force, and what the twin makes of them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import geometric_tension
from monochord.physics.twin import Scene, advance, begin, hold
from monochord.physics.twin.trajectory import (
    ACCELERATION,
    TRAVEL_HEIGHT,
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
    Waypoint,
    depth_under,
    force_at_depth,
    speed_profile,
    trajectory,
)

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


def plan(*moves: Move) -> Trajectory:
    return trajectory(moves, STRING, position=0.1)


def test_phases_follow_each_other_and_times_rise() -> None:
    motion = plan(*EVERYTHING)
    assert [phase.kind for phase in motion.phases] == [
        "tap", "travel", "approach", "press", "hold", "slide", "slide", "press", "hold", "release", "retreat",
        "travel",
    ]  # fmt: skip
    assert all(a.stop == b.start for a, b in pairwise(motion.phases))
    assert (np.diff([key.time for key in motion.keys]) > 0.0).all()


def test_the_path_is_smooth_except_for_taps() -> None:
    motion = plan(*EVERYTHING[1:])
    velocity = np.diff(motion.path(np.arange(0.0, motion.end, 1e-3)), axis=0) / 1e-3
    assert np.abs(velocity).max(axis=0) == pytest.approx([0.25, 0.25, 0.05], rel=0.6)
    assert np.abs(velocity).max() <= 0.26
    # Slopes are cut into four: the largest jump is a quarter of 0.25 m/s.
    assert np.abs(np.diff(velocity, axis=0)).max() < 0.07


def test_a_press_to_a_force_is_one_to_the_depth_of_that_force() -> None:
    depth = float(depth_under(STRING, 0.1, 1.3))
    by_force, by_depth = plan(Press(force=1.3)), plan(Press(depth=depth))
    for name in ("time", "force"):
        first, second = ([getattr(key, name) for key in one.keys] for one in (by_force, by_depth))
        assert first == pytest.approx(second)
    assert by_force.keys[-1].force == pytest.approx(1.3)
    assert by_force.path(np.array([by_force.end]))[0, 2] == pytest.approx(-depth)


def test_a_slide_along_keeps_its_depth_and_its_force_follows_the_string() -> None:
    motion = plan(Press(depth=6e-4), Slide(along=-0.05, speed=0.03))
    slide = motion.phases[-1]
    path = motion.path(np.linspace(slide.start, slide.stop, 200))
    np.testing.assert_allclose(path[:, 2], -6e-4, atol=2e-6)
    assert path[-1, 0] == pytest.approx(0.05)
    assert motion.keys[-1].force == pytest.approx(float(force_at_depth(STRING, 0.05, 6e-4)))
    middle = motion.path(np.array([0.5, 0.6]) * (slide.stop - slide.start) + slide.start)
    assert (middle[1, 0] - middle[0, 0]) / (0.1 * (slide.stop - slide.start)) == pytest.approx(-0.03)


def test_y_integrates_the_speed_across_and_travel_brings_it_back() -> None:
    motion = plan(
        Press(force=1.0), Slide(across=0.02, speed=0.01), Slide(across=-0.005, speed=0.03), Retreat(),
        Travel(position=0.06),
    )  # fmt: skip
    stops = [phase.stop for phase in motion.phases if phase.kind in ("slide", "travel")]
    np.testing.assert_allclose(motion.path(np.array(stops))[:, 1], [0.02, 0.015, 0.0], atol=1e-9)
    np.testing.assert_allclose(motion.path(np.array([motion.end]))[0, :2], [0.06, 0.0], atol=1e-9)
    assert max(abs(key.across) for key in motion.keys if key.force > 0.0) == pytest.approx(0.03)


def test_a_tap_is_a_v_of_one_speed() -> None:
    motion = plan(Stay(seconds=0.1, kind="rest"), Tap(force=1.0, speed=0.2))
    (tap,) = motion.taps
    depth = float(depth_under(STRING, 0.1, 1.0))
    assert tap == pytest.approx(0.1 + (TRAVEL_HEIGHT + depth) / 0.2)
    time = np.array([tap - 0.01, tap - 0.001, tap, tap + 0.001, tap + 0.01])
    np.testing.assert_allclose(motion.path(time)[:, 2], -depth + 0.2 * np.abs(time - tap), atol=1e-5)


def test_waypoints_set_the_state_at_their_time() -> None:
    motion = plan(
        Waypoint(time=0.1),
        Waypoint(time=0.2, force=0.7),
        Waypoint(time=0.2, force=0.8),  # at the same time: it replaces the one before
        Waypoint(time=0.5, position=0.12, force=0.8, across=0.01),
        Waypoint(time=0.6, clearance=1e-3),
        Travel(position=0.1),
    )
    assert [key.force for key in motion.keys[:4]] == [0.0, 0.0, 0.8, 0.8]
    place = motion.path(np.array([0.1, 0.35, 0.5, 0.6, motion.end]))
    np.testing.assert_allclose(place[:, 0], [0.1, 0.11, 0.12, 0.12, 0.1])
    np.testing.assert_allclose(place[:, 1], [0.0, 0.3 * 0.01 / 8, 0.0015, 0.002, 0.0], atol=1e-12)
    np.testing.assert_allclose(place[[0, 3, 4], 2], [0.0, 1e-3, 1e-3], atol=1e-12)


def test_lifted_is_the_same_motion_without_contact() -> None:
    motion = plan(*EVERYTHING)
    lifted = motion.lifted(2e-3)
    assert all(key.force == 0.0 for key in lifted.keys if key.time > motion.phases[0].stop)
    assert max(key.force for key in lifted.keys) == pytest.approx(1.0)  # the tap still touches
    time = np.linspace(motion.phases[1].stop, motion.end, 500)
    np.testing.assert_allclose(lifted.path(time), motion.path(time) + np.array([0.0, 0.0, 2e-3]), atol=2e-5)
    with pytest.raises(InputError, match="clearance"):
        motion.lifted(5e-4)


@pytest.mark.parametrize(
    "moves",
    [
        [Press()],
        [Press(force=1.0, depth=1e-3)],
        [Press(depth=-1e-3)],
        [Press(force=1.0), Travel(position=0.08)],
        [Press(force=1.0), Tap()],
        [Slide()],
        [Stay(seconds=0.0)],
        [Slide(along=0.01, speed=0.0)],
    ],
)
def test_moves_that_cannot_be_are_refused(moves: list[Move]) -> None:
    with pytest.raises(InputError):
        plan(*moves)


def test_a_tighter_string_turns_a_depth_into_a_larger_force() -> None:
    tighter = replace(STRING, tension=1.01 * STRING.tension)
    press = [Press(depth=5e-4)]
    usual, tight = (trajectory(press, string, position=0.1).keys[-1].force for string in (STRING, tighter))
    assert tight == pytest.approx(1.01 * usual, rel=1e-3)


@pytest.mark.parametrize(("distance", "speed"), [(0.1, 0.25), (0.0008, 0.05), (1e-5, 0.2), (0.03, 0.003)])
def test_a_speed_profile_stays_within_speed_and_acceleration(distance: float, speed: float) -> None:
    time, covered, velocity = np.array([(0.0, 0.0, 0.0), *speed_profile(distance, speed)]).T
    assert covered[-1] == pytest.approx(distance)
    assert velocity[-1] == pytest.approx(0.0, abs=1e-12)
    assert velocity.max() <= speed * (1.0 + 1e-9)
    assert np.abs(np.diff(velocity) / np.diff(time)).max() <= ACCELERATION * (1.0 + 1e-6)
    # The distance between two points is the integral of the speed, which runs linearly there.
    np.testing.assert_allclose(
        np.diff(covered), 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time), rtol=1e-6
    )


def test_force_and_depth_are_inverses_and_the_force_is_that_of_two_taut_sides() -> None:
    x, force = np.meshgrid(np.linspace(0.01, 0.19, 19), np.linspace(0.01, 5.0, 20))
    np.testing.assert_allclose(force_at_depth(STRING, x, depth_under(STRING, x, force)), force, rtol=1e-12)
    assert depth_under(STRING, 0.1, 0.0) == 0.0
    one = float(force_at_depth(STRING, 0.06, 1e-3))
    tension = float(geometric_tension(STRING, 0.06, one))
    assert one == pytest.approx(tension * (1e-3 / 0.06 + 1e-3 / (STRING.length - 0.06)))
    with pytest.raises(InputError, match="force"):
        depth_under(STRING, 0.1, -1.0)


def test_the_twin_at_rest_answers_with_the_force_of_the_depth() -> None:
    scene = Scene(touches=(hold(0.08, 1.2, load_material("plastic")),), drivers=(False, False))
    take, _ = advance(begin(load_sensor("prototype"), scene), 30000)
    assert take.labels.reaction[0, -5000:].mean() == pytest.approx(1.2, rel=5e-3)


def pressed_spans(motion: Trajectory) -> list[tuple[float, float]]:
    """Begin and end of each stretch in which the motion presses."""
    time = np.arange(0.0, motion.end, 1e-5)
    force = np.interp(time, [key.time for key in motion.keys], [key.force for key in motion.keys]) > 0.0
    begins, ends = (np.flatnonzero(np.diff(force.astype(int)) == way) for way in (1, -1))
    return [(float(time[a]), float(time[b])) for a, b in zip(begins, ends, strict=True)]


@pytest.mark.parametrize(("contact", "speed"), [(0.02, 0.01), (0.05, 0.2), (0.08, 0.05)])
def test_a_tap_of_a_contact_time_touches_that_long_and_to_its_force(contact: float, speed: float) -> None:
    motion = plan(Tap(force=1.0, speed=speed, contact=contact, kind="touch"))
    ((begin_, end),) = pressed_spans(motion)
    assert end - begin_ == pytest.approx(contact, abs=5e-5)
    deepest = [key.time for key in motion.keys if key.force == pytest.approx(1.0)]
    assert len(deepest) == 2
    assert deepest[1] - deepest[0] >= 0.2 * contact - 1e-9
    assert motion.taps == ()
    assert motion.keys[-1].clearance == TRAVEL_HEIGHT


def test_a_load_changes_the_force_linearly_at_one_place() -> None:
    motion = plan(Press(force=0.6), Load(force=1.2, seconds=0.2), Load(force=0.8, seconds=0.1), Retreat())
    start = next(phase.start for phase in motion.phases if phase.kind == "hold")
    times, forces = ([getattr(key, name) for key in motion.keys] for name in ("time", "force"))
    measured = np.interp(start + np.array([0.0, 0.1, 0.2, 0.25, 0.3]), times, forces)
    assert measured == pytest.approx([0.6, 0.9, 1.2, 1.0, 0.8])
    assert {key.position for key in motion.keys} == {0.1}


def test_a_sway_swings_by_its_amplitude_at_its_rate_and_ends_where_it_began() -> None:
    motion = plan(Press(force=1.0), Sway(amplitude=2e-3, rate=5.0, seconds=1.0), Retreat())
    sway = next(phase for phase in motion.phases if phase.kind == "sway")
    assert sway.stop - sway.start == pytest.approx(1.0)
    x = motion.path(np.arange(sway.start + 5e-4, sway.stop, 1e-3))[:, 0] - 0.1
    assert x.max() == pytest.approx(2e-3, rel=0.02)
    assert x.min() == pytest.approx(-2e-3, rel=0.02)
    assert np.abs(x[:20]).max() < 0.4e-3  # it begins at rest
    assert np.sum(np.diff(np.sign(x[5:-5])) != 0.0) == 9  # ten half periods
    assert motion.keys[-1].position == pytest.approx(0.1)


def test_a_hop_leaves_the_string_for_its_time_and_lands_at_its_place_and_depth() -> None:
    hop = Hop(position=0.13, depth=5e-4, seconds=0.05)
    motion = plan(Press(force=1.0), hop, Stay(seconds=0.1), Retreat())
    (_, up), (down, _) = pressed_spans(motion)
    assert down - up == pytest.approx(0.05, abs=5e-5)
    between = motion.path(np.arange(up + 1e-4, down - 1e-4, 1e-4))
    assert between[:, 2].min() >= 0.0
    landed = motion.path(np.array([down + 0.05]))[0]
    assert (landed[0], landed[2]) == pytest.approx((0.13, -5e-4))


@pytest.mark.parametrize(
    "move", [Load(force=1.0, seconds=0.1), Sway(amplitude=1e-3, rate=5.0, seconds=0.5),
             Hop(position=0.1, depth=1e-3, seconds=0.1)],
)  # fmt: skip
def test_what_happens_while_pressed_is_refused_in_the_air(move: Move) -> None:
    with pytest.raises(InputError, match="press first"):
        plan(move)


def test_a_robot_presses_no_harder_than_its_limit() -> None:
    motion = plan(Press(depth=8e-3))
    assert float(force_at_depth(STRING, 0.1, 8e-3)) > 10.0
    assert motion.keys[-1].force == 10.0
    assert motion.path(np.array([motion.end]))[0, 2] == pytest.approx(-float(depth_under(STRING, 0.1, 10.0)))
