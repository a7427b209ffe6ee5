import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.perception.features import FEATURES
from monochord_encoders.mel import LogMel
from monochord_encoders.resampling import Resampler

TWO = Signal(sample_rate=44100, channels=2)
SIZE = 4410


def tone(frequency: float, rate: int = 44100, size: int = SIZE) -> Audio:
    return np.sin(2 * np.pi * frequency * np.arange(size) / rate).astype(np.float32)


def test_it_is_mean_and_maximum_of_each_band_of_each_microphone() -> None:
    extract = FEATURES.build("log_mel").prepare(TWO, SIZE)
    window = np.stack([tone(374.0), tone(695.0)])
    sound = Resampler(sample_rate=44100, new_rate=16000, size=SIZE)(window)
    energies = LogMel(size=1600, hop=16, centred=True)(sound)
    row = extract(window[None])[0].reshape(2, 2, 128)
    assert np.array_equal(row[:, 0], energies.mean(axis=1))
    assert np.array_equal(row[:, 1], energies.max(axis=1))
    assert extract.columns[128] == "mic 1 max of band 1"
    assert extract.columns[-1] == "mic 2 max of band 128"


def test_context_is_left_out() -> None:
    extract = FEATURES.build("log_mel", {"context": 0.01}).prepare(TWO, SIZE + 441)
    bare = FEATURES.build("log_mel").prepare(TWO, SIZE)
    sound = np.stack([tone(374.0, size=SIZE + 441)] * 2)
    assert np.abs(extract(sound[None]) - bare(sound[None, :, 441:])).max() < 0.3
    loud = sound.copy()
    loud[:, :200] *= 100.0
    assert np.abs(extract(sound[None]) - extract(loud[None])).max() < 0.2


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="bins' = 0"):
        FEATURES.build("log_mel", {"bins": 0})
    feature = FEATURES.build("log_mel")
    with pytest.raises(InputError, match="8000 Hz"):
        feature.prepare(Signal(sample_rate=8000, channels=2), 800)
    with pytest.raises(InputError, match="ms"):
        feature.prepare(TWO, 10)
    with pytest.raises(InputError, match=r"\(1, 2, 100\)"):
        feature.prepare(TWO, SIZE)(np.zeros((1, 2, 100), np.float32))


def test_samples_that_are_not_numbers_are_silence() -> None:
    extract = FEATURES.build("log_mel").prepare(TWO, SIZE)
    windows = np.zeros((3, 2, SIZE), np.float32)
    windows[1], windows[2] = np.nan, np.inf
    rows = extract(windows)
    assert np.array_equal(rows[1], rows[0])
    assert np.array_equal(rows[2], rows[0])
    windows[0] = np.finfo(np.float32).max
    assert np.isfinite(extract(windows)).all()
