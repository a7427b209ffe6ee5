"""Alignment: known offsets and drifts of a whole session are found, flagged and taken away."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from studies.taps import RATE, Tapped, tapped
from tests.sessions.made import make, plain_readings

from monochord.core.errors import InputError
from monochord.core.types import POSE, Block, Feed
from monochord.core.units import Seconds
from monochord.sessions import (
    Description,
    ReadingTrack,
    SessionClock,
    SessionReader,
    SessionWriter,
    read_session,
)
from monochord.sessions.alignment import (
    Alignment,
    Limits,
    align,
    aligned_readings,
    calibration_spans,
    reading_times,
)

Late = Mapping[str, tuple[Seconds, Seconds]]


@cache
def played(seed: int = 0, groups: tuple[float, ...] = (1.5, 8.0), taps: int = 5) -> Tapped:
    truth = tapped(groups=groups, taps=taps, force=(1.0, 0.3, 2.0)[seed % 3], seed=seed)
    return replace(truth, rates=(1000.0, 250.0))


def recorded(folder: Path, truth: Tapped) -> SessionReader:
    path = folder / "taps.mcap"
    path.unlink(missing_ok=True)
    truth.write(path)
    return read_session(path)


def true_offset(truth: Tapped, stream: str, time: Seconds) -> Seconds:
    at = np.array([time])
    return float((truth.stamps(stream, at) - truth.stamps("wrench", at))[0])


@pytest.mark.parametrize("seed", range(3))
def test_known_offsets_at_both_ends_are_recovered(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    start = rng.uniform(-0.3, 0.3, 3)
    moved = rng.uniform(-0.4e-3, 0.4e-3, 3)
    late = {
        name: (float(a), float(a + b))
        for name, a, b in zip(("audio", "wrench", "pose"), start, moved, strict=True)
    }
    truth = replace(
        played(seed % 3),
        late=late,
        rates=((7000.0, 1000.0)[seed % 2], (100.0, 250.0, 500.0)[seed % 3]),
        seed=seed,
    )
    alignment = align(recorded(tmp_path, truth))
    assert alignment.reference == "wrench"
    assert alignment.flags == ()
    for end, centre in enumerate((truth.touches[:5].mean(), truth.touches[5:].mean())):
        audio, pose = (alignment.lateness[name].offsets[end] for name in ("audio", "pose"))
        assert audio.value == pytest.approx(true_offset(truth, "audio", centre), abs=0.5e-3)
        assert pose.value == pytest.approx(true_offset(truth, "pose", centre), abs=1.0 / truth.rates[1])
        assert audio.taps >= 4
        assert pose.taps == 5


def test_times_are_corrected_all_along_the_session(tmp_path: Path) -> None:
    late = {"audio": (0.05, 0.055), "wrench": (0.0, 0.0), "pose": (-0.2, -0.195)}
    truth = replace(played(), late=late)
    session = recorded(tmp_path, truth)
    alignment = align(session)
    true = np.linspace(0.5, 11.5, 50)
    audio = alignment.correct("audio", truth.stamps("audio", true))
    assert np.abs(audio - true).max() < 0.5e-3
    pose = aligned_readings(session, "pose", alignment)
    assert (np.diff(pose.time) > 0.0).all()
    bottom = pose.time[pose.column("z") < -2e-4]
    assert np.abs(bottom[:, None] - truth.touches - 0.003).min(axis=1).max() < 2.0 / truth.rates[1]
    wrench = aligned_readings(session, "wrench", alignment)
    known = np.interp(wrench.time, np.arange(truth.force.size) / RATE, truth.force)
    assert np.corrcoef(known, wrench.column("fz"))[0, 1] > 0.9


def test_a_drift_is_measured_and_flagged(tmp_path: Path) -> None:
    truth = replace(played(), late={"audio": (0.01, 0.0125), "pose": (0.0, 0.03)})
    alignment = align(recorded(tmp_path, truth))
    audio, pose = alignment.lateness["audio"], alignment.lateness["pose"]
    assert audio.ppm == pytest.approx(2.5e-3 / 12.0 * 1e6, abs=60.0)
    assert pose.ppm == pytest.approx(0.03 / 12.0 * 1e6, abs=300.0)
    assert audio.drift == pytest.approx(
        2.5e-3 / 12.0 * 6.5, abs=3.0 * math.hypot(*(offset.std for offset in audio.offsets))
    )
    assert [flag.split()[0] for flag in alignment.flags] == ["audio", "pose"]
    assert all("drift" in flag for flag in alignment.flags)
    loose = align(recorded(tmp_path, truth), Limits(drift=5e-3, intervals=10.0))
    assert loose.flags == ()


def test_a_session_without_taps_is_left_alone_and_says_so(tmp_path: Path) -> None:
    truth = replace(played(), force=np.zeros(12 * RATE))
    session = recorded(tmp_path, truth)
    alignment = align(session)
    (flag,) = alignment.flags
    assert "no taps in wrench" in flag
    time = np.array([0.0, 5.0])
    assert (alignment.correct("audio", time) == time).all()
    assert (
        aligned_readings(session, "pose", alignment).time
        == np.sort(reading_times(session.readings("pose")).time)
    ).all()


def test_readings_that_are_no_numbers_do_not_matter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = recorded(tmp_path, replace(played(), late={"audio": (0.05, 0.05)}))
    real = SessionReader.readings

    def holed(session: SessionReader, stream: str) -> ReadingTrack:
        track = real(session, stream)
        track.values[::50] = np.nan
        return track

    monkeypatch.setattr(SessionReader, "readings", holed)
    alignment = align(session)
    assert alignment.flags == ()
    assert alignment.lateness["audio"].offsets[0].value == pytest.approx(0.05, abs=0.5e-3)


def test_readings_that_overtook_each_other_are_put_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = recorded(tmp_path, replace(played(), late={"audio": (0.05, 0.05)}))
    as_stamped = Alignment(reference="wrench", lateness={})
    straight = {name: aligned_readings(session, name, as_stamped) for name in ("wrench", "pose")}
    real = SessionReader.readings

    def overtaken(session: SessionReader, stream: str) -> ReadingTrack:
        track = real(session, stream)
        order = np.arange(track.time.size)
        first = np.arange(20, order.size - 1, 50)
        order[first], order[first + 1] = first + 1, first
        columns = ("time", "values", "sequence", "device_time")
        changed = {name: getattr(track, name)[order] for name in columns}
        return replace(track, **changed | {"time": np.maximum.accumulate(changed["time"])})

    monkeypatch.setattr(SessionReader, "readings", overtaken)
    alignment = align(session)
    assert alignment.flags == ()
    assert alignment.lateness["audio"].offsets[0].value == pytest.approx(0.05, abs=0.5e-3)
    for name, expected in straight.items():
        track = aligned_readings(session, name, as_stamped)
        assert np.abs(track.time - expected.time).max() < 1e-6
        assert np.array_equal(track.values, expected.values)


def test_the_sound_of_a_tap_travels_to_the_microphones(tmp_path: Path) -> None:
    session = recorded(tmp_path, played())
    fast = session.description.string
    assert fast is not None
    offset = align(session).lateness["audio"].offsets[0].value
    session.description = replace(session.description, string=replace(fast, tension=fast.tension / 100.0))
    slow_offset = align(session).lateness["audio"].offsets[0].value
    travel = 0.5 * fast.length / np.sqrt(fast.tension / fast.linear_density)
    assert offset - slow_offset == pytest.approx(9.0 * travel, rel=1e-6)  # ten times as long on the way


def test_without_events_there_are_no_labels_around_the_taps(tmp_path: Path) -> None:
    truth = played()
    session = recorded(tmp_path, truth)
    spans = calibration_spans(session, align(session))

    def is_free(time: float) -> bool:
        return not any(begin <= time <= end for begin, end in spans)

    assert not any(is_free(time) for time in (0.0, *truth.touches, truth.seconds))
    assert is_free(0.5 * float(truth.touches.min() + truth.touches.max()))


def test_a_force_sensor_that_never_spoke_is_flagged(tmp_path: Path) -> None:
    feed = Feed(stream="wrench", columns=("fz",), units=("N",))
    with SessionWriter(tmp_path / "a.mcap", Description(name="a", sample_rate=1000, feeds=(feed,))) as writer:
        writer.audio(Block(samples=np.zeros((2, 1000), np.float32), start=0, adc_time=writer.clock.origin))
    (flag,) = align(read_session(tmp_path / "a.mcap")).flags
    assert "wrench" in flag


def test_taps_at_one_end_give_the_offset_but_no_drift(tmp_path: Path) -> None:
    truth = replace(played(groups=(1.5,)), late={"audio": (0.1, 0.1)})
    alignment = align(recorded(tmp_path, truth))
    (flag,) = alignment.flags
    assert "drift" in flag
    assert np.isnan(alignment.lateness["audio"].drift)
    assert alignment.correct("audio", np.array([11.1]))[0] == pytest.approx(11.0, abs=0.5e-3)
    assert len(alignment.taps) == 1


def test_a_tap_that_only_the_force_notices_is_left_out(tmp_path: Path) -> None:
    truth = replace(played(taps=3), late={"audio": (0.05, 0.05)})
    masked, first = truth.microphones.copy(), round((truth.touches[1] - 0.02) * RATE)
    masked[:, first : first + 2205] = 1e-4 * np.random.default_rng(0).standard_normal((2, 2205))
    alignment = align(recorded(tmp_path, replace(truth, microphones=masked)))
    offset = alignment.lateness["audio"].offsets[0]
    assert offset.taps == 2
    assert offset.value == pytest.approx(0.05, abs=0.5e-3)
    assert "audio shows 2 taps" in alignment.flags[0]


@pytest.mark.parametrize("before", [0.1, 0.005])
def test_a_knock_that_only_the_microphones_notice_does_no_harm(before: float, tmp_path: Path) -> None:
    truth = replace(played(taps=3), late={"audio": (0.05, 0.05)})
    knocked, first = truth.microphones.copy(), round((truth.touches[1] - before) * RATE)
    knocked[:, first : first + 400] += 0.2 * np.random.default_rng(0).standard_normal((2, 400))
    alignment = align(recorded(tmp_path, replace(truth, microphones=knocked)))
    offset = alignment.lateness["audio"].offsets[0]
    assert alignment.flags or offset.taps == 3
    assert offset.value == pytest.approx(0.05, abs=0.5e-3)


def test_an_offset_beyond_the_limit_is_reported(tmp_path: Path) -> None:
    truth = replace(played(), late={"audio": (1.2, 1.2)})
    flags = align(recorded(tmp_path, truth)).flags
    assert len(flags) == 2
    assert all("audio is 1.20 s late" in flag for flag in flags)


def test_a_stream_without_taps_is_flagged(tmp_path: Path) -> None:
    truth = replace(played(), microphones=np.zeros((2, 12 * RATE), np.float32))
    alignment = align(recorded(tmp_path, truth))
    assert "audio shows no taps" in alignment.flags[0]
    assert alignment.correct("audio", np.ones(1)).tolist() == [1.0]


def test_a_wall_clock_that_was_set_is_flagged(tmp_path: Path) -> None:
    path = tmp_path / "clocks.mcap"
    with SessionWriter(path, Description(name="x", sample_rate=RATE), SessionClock.now()) as writer:
        begin = writer.clock.origin
        for second, offset in enumerate((1e9, 1e9 + 1e-4, 1e9 + 3600.0, 1e9 + 3600.0)):
            writer.clocks(begin + second, {"realtime": offset})
        writer.audio(Block(samples=np.zeros((2, 441), np.float32), start=0, adc_time=begin))
    (flag,) = align(read_session(path)).flags
    assert "wall clock" in flag
    assert "+3600.000 s" in flag


def test_without_a_force_the_pose_is_put_on_the_microphones_clock(tmp_path: Path) -> None:
    truth = played()
    feed = Feed(stream="pose", columns=POSE, units=("m",) * 3 + ("",) * 4, rate=100.0)
    path, rate = tmp_path / "pose.mcap", 100.0
    description = Description(name="pose", sample_rate=RATE, feeds=(feed,))
    with SessionWriter(path, description, SessionClock(epoch_ns=10**18, origin=0.0)) as writer:
        for start in range(0, truth.force.size, 4410):
            samples = truth.microphones[:, start : start + 4410]
            writer.audio(Block(samples=samples, start=start, adc_time=start / RATE))
        time = np.arange(0.0, truth.seconds, 1.0 / rate)
        values = np.zeros((time.size, 7))
        values[:, 2], values[:, 6] = truth.height(time), 1.0
        writer.readings(plain_readings("pose", time + 0.15, values))
    alignment = align(read_session(path))
    assert alignment.reference == "audio"
    assert alignment.flags == ()
    for offset in alignment.lateness["pose"].offsets:
        assert offset.value == pytest.approx(0.15, abs=1.0 / rate)
    assert np.abs(np.concatenate(alignment.taps) - truth.touches).max() < 1.0 / rate


def test_a_stream_that_is_not_there_is_refused(tmp_path: Path) -> None:
    make(tmp_path / "a.mcap", seconds=0.1)
    with pytest.raises(InputError, match="'gripper'"):
        aligned_readings(
            read_session(tmp_path / "a.mcap"), "gripper", Alignment(reference="wrench", lateness={})
        )
