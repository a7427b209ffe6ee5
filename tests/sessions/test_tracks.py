import numpy as np
import pytest

from monochord.core.types import Feed
from monochord.sessions import AudioTrack, ReadingTrack


def track(frames: np.ndarray, times: np.ndarray) -> AudioTrack:
    return AudioTrack(
        samples=np.zeros((2, 10), np.float32),
        sample_rate=44100,
        anchor_frame=frames,
        anchor_time=times,
        device_frame=np.full(len(frames), -1),
    )


@pytest.mark.parametrize("off", [-80e-6, 0.0, 35e-6])
def test_the_rate_of_a_converter_is_estimated(off: float) -> None:
    random = np.random.default_rng(0)
    frames = np.arange(0.0, 60 * 44100, 4410)
    times = 0.25 + frames / 44100 * (1 + off) + 20e-6 * random.standard_normal(len(frames))
    times[::37] += 0.02  # late wake-ups
    audio = track(frames, times)
    assert audio.time(30 * 44100) == pytest.approx(0.25 + 30 * (1 + off), abs=10e-6)
    assert audio.frame(audio.time(1234.5)) == pytest.approx(1234.5, abs=1e-6)


def test_with_few_anchors_the_nominal_rate_stands() -> None:
    assert track(np.zeros(0), np.zeros(0)).time(44100) == 1.0
    assert track(np.array([441.0]), np.array([2.01])).time(44541) == pytest.approx(3.01)
    frames = np.arange(0.0, 20000, 4410)
    assert track(frames, frames / 44100 * 1.01).line[0] == 44100


def test_missing_readings_are_counted_and_a_restart_is_none() -> None:
    sequence = np.array([5, 6, 9, 10, 0, 1, 4])
    n = len(sequence)
    readings = ReadingTrack(
        feed=Feed(stream="a", columns=("b",), units=("",)),
        time=np.arange(n) / 10,
        values=np.zeros((n, 1)),
        sequence=sequence,
        device_time=np.full(n, -1),
        status=np.zeros(n, np.uint32),
    )
    assert readings.missing == 4


def test_a_device_that_stood_still_is_noticed_and_a_late_moment_is_not() -> None:
    frames = np.arange(0.0, 20 * 44100, 4410)
    times = frames / 44100
    times[50] += 0.03
    assert track(frames, times).unevenness < 1e-4
    times[120:] += 0.004
    assert track(frames, times).unevenness > 1.5e-3
    assert track(frames[:3], times[:3]).unevenness == 0.0
