"""Labels come from where they should, and only from sessions whose streams are on one clock."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.datasets.conftest import Write
from tests.sessions.made import plain_readings

from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Block, Feed
from monochord.datasets.truth import SessionTruth, truth_of
from monochord.sessions import (
    Description,
    ReadingTrack,
    SessionClock,
    SessionReader,
    SessionWriter,
    read_session,
)


@pytest.fixture(scope="session", name="slide")
def _slide(small: Path) -> Path:
    """A session of the virtual bench, sliding touches, its streams late by different amounts."""
    return small / "slide_000.mcap"


def test_labels_of_a_session_without_instruments_are_on_the_microphones_clock(write: Write) -> None:
    truth = truth_of(read_session(write("one")))
    assert truth.source == "recorded"
    assert truth.time_of(np.array([1.25])).tolist() == [1.25]
    assert truth.calibrating == ()


@pytest.fixture(scope="module", name="truth")
def _truth(slide: Path) -> SessionTruth:
    return truth_of(read_session(slide))


def test_measured_labels_agree_with_those_of_the_bench(slide: Path, truth: SessionTruth) -> None:
    assert truth.source == "recorded"
    recorded, measured = truth.labels, truth_of(read_session(slide), "measured").labels
    at = np.rint((measured.time - recorded.time[0]) * 1000).astype(int)
    inside = (at >= 0) & (at < recorded.time.size)

    def both(name: str) -> tuple[np.ndarray, np.ndarray]:
        return recorded.columns[name][at[inside]], measured.columns[name][inside]

    touched, estimated = both("contact")
    assert np.mean(touched == estimated) > 0.98
    deep = (touched == 1.0) & (both("force")[0] > 0.2)
    for name, limit in (("position", 1e-4), ("force", 0.05)):
        exact, estimated = both(name)
        assert np.nanquantile(np.abs(estimated - exact)[deep], 0.95) < limit
    exact, estimated = both("slip")
    assert np.mean((exact == estimated)[deep]) > 0.93


def test_sound_is_late_by_what_the_taps_tell(truth: SessionTruth) -> None:
    late = truth.alignment.lateness["audio"].offsets[0].value
    assert abs(late) > 1e-3
    assert truth.time_of(np.array([10.0]))[0] == pytest.approx(10.0 - late, abs=5e-4)


def test_the_string_is_calibrated_while_its_drivers_are_off(slide: Path, truth: SessionTruth) -> None:
    events = read_session(slide).events
    switched = {event.text: event.time for event in events if event.kind == "drivers"}
    assert truth.calibrating == ((-np.inf, switched["on"]), (switched["off"], np.inf))


def test_readings_with_a_fault_measure_nothing(slide: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = SessionReader.readings

    def faulty(session: SessionReader, stream: str) -> ReadingTrack:
        track = real(session, stream)
        status = np.where((track.time > 5.0) & (track.time < 6.0), 1 << 31, 0).astype(np.uint32)
        values = np.where((track.time > 7.0)[:, None] & (track.time < 7.01)[:, None], np.nan, track.values)
        return replace(track, status=status, values=values if stream == "wrench" else track.values)

    monkeypatch.setattr(SessionReader, "readings", faulty)
    labels, forced = (
        truth_of(read_session(slide), "measured", force=force).labels for force in (False, True)
    )
    inside = (labels.time > 5.2) & (labels.time < 5.8)
    assert np.isnan(labels.columns["force"][inside]).all()
    assert np.isfinite(forced.columns["force"]).all()
    assert np.isfinite(labels.columns["force"][labels.time < 4.8]).all()


def silent(path: Path, *, taps: bool = False, events: bool = False, streams: bool = True) -> Path:
    """A session of readings without labels, touched or tapped."""
    feeds = tuple(
        Feed(stream=name, columns=columns, units=("1",) * len(columns), rate=1000.0)
        for name, columns in (("wrench", WRENCH), ("pose", POSE))
    )
    description = Description(name=path.stem, sample_rate=8000, feeds=feeds if streams else ())
    time = np.arange(0.0, 10.0, 1e-3)
    with SessionWriter(path, description, SessionClock(epoch_ns=10**18)) as writer:
        rng = np.random.default_rng(0)
        writer.audio(Block(samples=rng.normal(size=(2, 80000)).astype(np.float32), start=0, adc_time=0.0))
        for feed in description.feeds:
            values = np.zeros((time.size, len(feed.columns)))
            values[(time > 4.0) & (time < 6.0), 2] = 1.0
            writer.readings(plain_readings(feed.stream, time, values, sequence=np.arange(time.size)))
    return path


def test_a_session_that_is_not_on_one_clock_is_refused_unless_forced(tmp_path: Path) -> None:
    session = read_session(silent(tmp_path / "loose.mcap"))
    with pytest.raises(InputError, match=r"loose\.mcap.*no taps.*--force"):
        truth_of(session)
    forced = truth_of(session, force=True)
    assert forced.source == "measured"
    assert forced.alignment.flags


def test_a_session_without_what_labels_need_is_refused(tmp_path: Path, write: Write) -> None:
    bare = read_session(silent(tmp_path / "bare.mcap", streams=False))
    with pytest.raises(InputError, match=r"bare\.mcap"):
        truth_of(bare)
    with pytest.raises(InputError, match=r"bare\.mcap.*--labels measured"):
        truth_of(bare, "recorded")
    with pytest.raises(InputError, match=r"one\.mcap"):
        truth_of(read_session(write("one")), "measured")
    with pytest.raises(InputError, match="guessed"):
        truth_of(bare, "guessed")
