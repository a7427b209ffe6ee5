"""A session at another sample rate: what was heard when, and all else as it was."""

from pathlib import Path

import numpy as np
import pytest
from tests.sessions.made import EPOCH, description, make, plain_readings

from monochord.core.errors import InputError
from monochord.core.types import Block
from monochord.sessions import SessionClock, SessionReader, SessionWriter, check, read_session
from monochord.sessions.resample import resample

RATE, PITCH = 44100, 1000.0


def tone(time: np.ndarray) -> np.ndarray:
    """Both microphones at times (n,) in s: a tone that grows at one and fades at the other."""
    return np.stack((time, 2.0 - time)) * 0.3 * np.sin(2.0 * np.pi * PITCH * time)


def recorded(path: Path, rate: int) -> SessionReader:
    """A session of two seconds, without the frames from 0.9 to 1.1 s, with a reading and two events."""
    time = np.arange(2 * rate) / rate
    sound = tone(time).astype(np.float32)
    about = description(sample_rate=rate)
    with SessionWriter(path, about, SessionClock(epoch_ns=EPOCH, origin=0.0)) as writer:
        writer.event(0.25, "note", "before")
        size, lost = rate // 50, 0
        for k in range(100):
            start = k * size
            if 45 <= k < 55:
                lost += size
                continue
            part = sound[:, start : start + size]
            writer.audio(Block(samples=part, start=start, dropped=lost, adc_time=start / rate))
            lost = 0
            writer.labels(time[start : start + 1], {"contact": np.ones(1)})
        writer.readings(plain_readings("oven", np.array([1.5]), np.array([[300.0, 1.0]])))
        writer.event(1.75, "note", "after")
    return read_session(path)


@pytest.mark.parametrize("rate", [16000, 96000])
def test_sound_and_gaps_are_where_they_were(tmp_path: Path, rate: int) -> None:
    given = recorded(tmp_path / "given.mcap", rate)
    resample(given, tmp_path / "new.mcap", RATE)
    assert check(tmp_path / "new.mcap").sound
    new = read_session(tmp_path / "new.mcap")
    assert new.description.sample_rate == RATE
    ((first, stop),) = new.audio.gaps
    assert (first / RATE, stop / RATE) == pytest.approx((0.9, 1.1), abs=1e-4)
    time = np.arange(new.audio.samples.shape[1]) / RATE
    assert time[-1] == pytest.approx(2.0, abs=1e-3)
    inside = np.minimum(np.abs(time[:, None] - [0.0, 0.9, 1.1, 2.0]).min(axis=1), 1.0) > 0.02
    inside &= (time < 0.9) | (time > 1.1)
    error = new.audio.samples[:, inside] - tone(time[inside])
    assert np.abs(error).max() < 1e-3
    frames = np.array([0.0, 30000.0, 80000.0])
    old_frames = frames / RATE * rate
    assert new.audio.time(frames) == pytest.approx(given.audio.time(old_frames), abs=2e-5)


def test_all_else_stays(tmp_path: Path) -> None:
    given = recorded(tmp_path / "given.mcap", 48000)
    resample(given, tmp_path / "new.mcap", RATE)
    new = read_session(tmp_path / "new.mcap")
    assert new.events == given.events
    assert new.clock == given.clock
    assert np.array_equal(new.labels.time, given.labels.time)
    assert np.array_equal(new.readings("oven").values, given.readings("oven").values)
    assert new.description.feeds == given.description.feeds
    assert new.description.more["resampled"] == "from 48000 Hz"


def test_what_cannot_be_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    make(tmp_path / "given.mcap", seconds=0.2).close()
    given = read_session(tmp_path / "given.mcap")
    with pytest.raises(InputError, match="44100 Hz"):
        resample(given, tmp_path / "new.mcap", RATE)
    with pytest.raises(InputError, match=r"given\.mcap"):
        resample(given, tmp_path / "given.mcap", 48000)
    with pytest.raises(InputError, match="0 Hz"):
        resample(given, tmp_path / "new.mcap", 0)
    assert [path.name for path in tmp_path.iterdir()] == ["given.mcap"]
    assert check(tmp_path / "given.mcap").sound
