from dataclasses import replace
from functools import cache
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.lab.tiny import quiet, session, tiny

from monochord.core.types import Floats
from monochord.lab.plan import Group, MeasurementErrors
from monochord.lab.render import Rendering, concatenate, first_reading, pieces, render
from monochord.lab.schedule import Schedule, schedule
from monochord.physics.twin.outside import untouched_power
from monochord.physics.twin.trajectory import depth_under
from monochord.sessions import Event

GROUPS = (
    Group(name="hold", grid=(2, 1), forces=(0.8, 1.2), hold=0.5),
    Group(name="slide", protocol="slide", grid=(2, 1), forces=(0.8, 1.2), hold=0.5, strokes=2,
          speeds=(0.01, 0.03)),
)  # fmt: skip


@cache
def performed(name: str) -> tuple[Schedule, Rendering]:
    """Return a session of `GROUPS` without the instruments' noise, to be read alone."""
    one = session(name, quiet(groups=GROUPS, force_rate=7000.0))
    return schedule(one), render(one)


@pytest.fixture(params=["hold_000", "slide_000"])
def session_(request: pytest.FixtureRequest) -> tuple[Schedule, Rendering]:
    return performed(request.param)


def during(timing: Schedule, kind: str, time: Floats, after: float = 0.0) -> list[np.ndarray]:
    """Masks of the times in each phase of a kind, `after` s and more from its ends."""
    phases = [phase for phase in timing.motion.phases if phase.kind == kind]
    return [(time > phase.start + after) & (time < phase.stop - after) for phase in phases]


def test_every_stream_lasts_as_long_as_the_motion(session_: tuple[Schedule, Rendering]) -> None:
    timing, sound = session_
    for time, rate in (
        (sound.wrench_time, 7000.0), (sound.pose_time, 250.0), (sound.label_time, 1000.0),
    ):  # fmt: skip
        assert time[0] == 0.0
        assert time[-1] == pytest.approx(timing.motion.end, abs=2.0 / rate)
        np.testing.assert_allclose(np.diff(time), 1.0 / rate)
    assert sound.seconds == pytest.approx(timing.motion.end, abs=1e-4)


def test_the_pose_is_where_the_label_says(session_: tuple[Schedule, Rendering]) -> None:
    _, sound = session_
    touched = sound.labels["contact"] == 1.0
    tool = np.interp(sound.label_time, sound.pose_time, sound.pose[:, 0])
    assert np.abs(tool - sound.labels["position"])[touched].max() < 5e-5
    assert np.isnan(sound.labels["position"][~touched]).all()
    np.testing.assert_array_equal(np.linalg.norm(sound.pose[:, 3:], axis=1), 1.0)


def test_the_force_is_that_of_the_depth_and_the_sensor_feels_it(session_: tuple[Schedule, Rendering]) -> None:
    timing, sound = session_
    string = timing.motion.string
    height = np.interp(sound.label_time, sound.pose_time, sound.pose[:, 2])
    for within in during(timing, "settle", sound.label_time, 0.02):
        force, x = sound.labels["force"][within].mean(), sound.labels["position"][within].mean()
        assert -height[within].mean() == pytest.approx(float(depth_under(string, x, force)), rel=0.02)
    for low, high in zip(
        during(timing, "settle", sound.label_time, 0.02), during(timing, "settle", sound.wrench_time, 0.02),
        strict=True,
    ):  # fmt: skip
        assert sound.wrench[high, 2].mean() == pytest.approx(sound.labels["force"][low].mean(), rel=2e-3)
    pressed = during(timing, "settle", sound.wrench_time, 0.02)[0]
    assert sound.wrench[pressed, 2].std() > 3e-3  # the string's vibration


def test_the_label_of_force_does_not_lag(session_: tuple[Schedule, Rendering]) -> None:
    timing, sound = session_
    keys = timing.motion.keys
    expected = np.interp(sound.label_time, [key.time for key in keys], [key.force for key in keys])
    press = during(timing, "press", sound.label_time)[0]
    label = np.nan_to_num(sound.labels["force"])
    shifts = range(-6, 7)
    miss = [np.abs(np.roll(label, -shift) - expected)[press].sum() for shift in shifts]
    assert abs(shifts[int(np.argmin(miss))]) <= 1


def test_taps_are_sharp_in_all_three_streams(session_: tuple[Schedule, Rendering]) -> None:
    timing, sound = session_
    level = np.abs(sound.microphones)
    for tap in timing.taps:
        near = np.abs(sound.wrench_time - tap) < 0.03
        force = np.where(near, sound.wrench[:, 2], 0.0)
        assert 0.7 < force.max() < 1.3
        assert abs(sound.wrench_time[force.argmax()] - tap) < 2e-3
        height = np.where(np.abs(sound.pose_time - tap) < 0.03, sound.pose[:, 2], 1.0)
        assert abs(sound.pose_time[height.argmin()] - tap) <= 0.5 / 250.0 + 1e-9
        frame = round((tap - 0.0045) * sound.sample_rate)
        quiet_before = level[:, frame - 800 : frame - 100].max(axis=1)
        assert (level[:, frame : frame + 300].max(axis=1) > 20.0 * quiet_before).all()
    assert [event.time for event in sound.events if event.kind == "tap"] == list(timing.taps)


def test_slides_have_their_direction_and_friction() -> None:
    timing, sound = performed("slide_000")
    speed = np.gradient(sound.pose[:, :2], sound.pose_time, axis=0)
    for i, (label, pose) in enumerate(
        zip(
            during(timing, "slide", sound.label_time, 0.1), during(timing, "slide", sound.pose_time, 0.1),
            strict=True,
        )
    ):  # fmt: skip
        assert sound.labels["slip"][label].mean() > 0.97
        way, other, axis = ("across", "along", 1) if i < 2 else ("along", "across", 0)
        expected = speed[pose, axis].mean()
        assert sound.labels[f"slip_{way}"][label].mean() == pytest.approx(expected, rel=0.08)
        assert abs(sound.labels[f"slip_{other}"][label].mean()) < 0.1 * abs(expected)
        drag = sound.wrench[during(timing, "slide", sound.wrench_time, 0.1)[i]].mean(axis=0)
        assert drag[axis] * expected < 0.0
        assert 0.2 < abs(drag[axis]) / drag[2] < 0.4  # friction of plastic
    for label in during(timing, "settle", sound.label_time, 0.05):
        assert sound.labels["slip"][label].max() == 0.0


def test_pieces_of_any_length_make_the_same_session(monkeypatch: pytest.MonkeyPatch) -> None:
    one = session("hold_000")
    whole = render(one)
    monkeypatch.setattr(import_module("monochord.lab.render"), "CHUNK", 0.777)
    parts = list(pieces(one))
    assert len(parts) > 8
    again = concatenate(parts)
    np.testing.assert_array_equal(again.microphones, whole.microphones)
    np.testing.assert_array_equal(again.pose, whole.pose)
    np.testing.assert_allclose(again.wrench, whole.wrench, rtol=0.0, atol=1e-6)
    assert again.events == whole.events
    for name, values in whole.labels.items():
        np.testing.assert_allclose(again.labels[name], values, rtol=0.0, atol=1e-6, equal_nan=True)


def test_music_is_at_its_ratio_and_pauses_for_the_taps(tmp_path: Path) -> None:
    time = np.arange(44100) / 44100.0
    soundfile.write(tmp_path / "hum.wav", 0.3 * np.sin(2.0 * np.pi * 6000.0 * time), 44100, subtype="FLOAT")
    names = ("", "synthetic", str(tmp_path / "hum.wav"))
    groups = [Group(name="hold", grid=(1, 1), hold=0.2, music=name, snr=6.0) for name in names]
    one, *others = (session("hold_000", tiny(groups=(group,))) for group in groups)
    timing, silent = schedule(one), render(one)
    for loud in map(render, others):
        added = loud.microphones - silent.microphones
        on, off = round(timing.on * 44100), round(timing.off * 44100)
        np.testing.assert_array_equal(added[:, :on], 0.0)
        power = np.mean(added[:, on + 4410 : on + 30000].astype(float) ** 2)
        expected = untouched_power(one.sensor()) / 10.0**0.6
        assert 0.3 * expected < power < 10.0 * expected  # the string answers, and may lock elsewhere
        last = added[:, round((timing.taps[3] - 0.1) * 44100) : round((timing.taps[3] - 0.03) * 44100)]
        assert off < round((timing.taps[3] - 0.5) * 44100)
        assert np.abs(last).max() < 0.01


def chunk(start: int, stop: int) -> Rendering:
    """Streams whose values are their own times in ms."""
    columns: dict[str, list[float]] = {}
    for name, rate in (("wrench", 7000.0), ("pose", 250.0), ("labels", 1000.0)):
        first, last = first_reading(start, rate, 44100), first_reading(stop, rate, 44100)
        columns[name] = [1e3 * i / rate for i in range(first, last)]
    return Rendering(
        start=start,
        sample_rate=44100,
        force_rate=7000.0,
        pose_rate=250.0,
        label_rate=1000.0,
        microphones=np.zeros((2, stop - start), np.float32),
        wrench=np.repeat(np.array(columns["wrench"])[:, None], 6, axis=1),
        pose=np.repeat(np.array(columns["pose"])[:, None], 7, axis=1),
        labels={"contact": np.array(columns["labels"])},
        events=(Event(time=start / 44100, kind="phase", text="hold"),),
    )


@pytest.mark.parametrize("edges", [(0, 1, 2, 5000), (0, 441, 882, 44100), (100, 12345, 50001)])
def test_chunks_concatenate_without_a_reading_twice_or_missing(edges: tuple[int, ...]) -> None:
    parts = [chunk(a, b) for a, b in pairwise(edges)]
    whole, once = concatenate(parts), chunk(edges[0], edges[-1])
    for name in ("wrench", "pose", "microphones"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(once, name))
    for time, values in (
        (whole.wrench_time, whole.wrench[:, 0]), (whole.pose_time, whole.pose[:, 0]),
        (whole.label_time, whole.labels["contact"]),
    ):  # fmt: skip
        np.testing.assert_allclose(1e3 * time, values, atol=1e-9)
    assert (whole.begin, whole.seconds) == (once.begin, once.seconds)
    assert len(whole.events) == len(parts)


def test_a_tool_that_hovers_never_meets_a_string_at_rest() -> None:
    hover = Group(name="hover", protocol="hover", grid=(2, 1), hold=0.3, clearances=(3e-4, 4e-4))
    one = session("hover_000", quiet(groups=(hover,)))
    timing, sound = schedule(one), render(one)
    height = np.interp(sound.label_time, sound.pose_time, sound.pose[:, 2])
    phases = during(timing, "hover", sound.label_time)
    assert len(phases) == 2
    for within in phases:
        assert ((height[within] >= 3e-4 - 1e-9) & (height[within] <= 4e-4 + 1e-9)).all()


def test_an_oblique_press_loads_the_touch_sideways() -> None:
    one = session("oblique_000", quiet(groups=(replace(GROUPS[0], name="oblique", oblique=(0.5, 0.5)),)))
    timing, sound = schedule(one), render(one)
    within = during(timing, "settle", sound.label_time)[0]
    at = np.searchsorted(sound.pose_time, sound.label_time[within][0])
    place = sound.pose[at]
    assert abs(place[1]) == pytest.approx(-0.5 * place[2], rel=0.02)


def test_errors_of_pose_and_force_change_what_is_measured_and_not_what_is_true() -> None:
    errors = MeasurementErrors(tool=4e-4, repeat=1.5e-4, gain=0.01)
    true = performed("hold_000")[1]
    sound = render(session("hold_000", quiet(groups=GROUPS, force_rate=7000.0, errors=errors)))
    np.testing.assert_array_equal(true.microphones, sound.microphones)
    np.testing.assert_array_equal(true.labels["position"], sound.labels["position"])
    off = sound.pose[:, 0] - true.pose[:, 0]
    assert len(np.unique(off.round(9))) == 4  # before the first touch, two touches, and after
    assert 1e-5 < np.abs(off).max() < 2e-3
    pressed = true.wrench[:, 2] > 0.5
    ratio = sound.wrench[pressed, 2] / true.wrench[pressed, 2]
    assert ratio.std() < 1e-12
    assert 1e-4 < abs(ratio.mean() - 1.0) < 0.04


def test_motors_sound_in_the_frame_as_the_tool_moves() -> None:
    loud = replace(GROUPS[0], name="motors", motors="synthetic", motor_snr=20.0)
    one = session("motors_000", quiet(groups=(loud,)))
    timing, sound = schedule(one), render(one)
    still = render(session("motors_000", quiet(groups=(replace(loud, motors=""),))))
    added = sound.microphones - still.microphones
    time = np.arange(added.shape[1]) / 44100
    assert not added[:, time < timing.on].any()
    rest = timing.on + 1.0 < time
    rest &= time < timing.on + 1.2  # the string rings, and nothing has moved yet
    travel = np.any(during(timing, "travel", time), axis=0) & (time > timing.on) & (time < timing.off)
    level = {name: np.sqrt(np.mean(added[:, of] ** 2)) for name, of in (("rest", rest), ("travel", travel))}
    assert level["travel"] > 2.0 * level["rest"] > 0.0


def test_a_second_object_stays_on_the_string_where_it_ends() -> None:
    one = session("pair_000", quiet(groups=(replace(GROUPS[0], name="pair", second=0.15),)))
    sound = render(one)
    assert np.abs(sound.microphones).max() > 0.0
