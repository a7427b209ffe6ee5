"""One microphone alone, and nothing of the other."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Signal
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor
from monochord.physics.strings import load_string

RATE, SIZE = 44100, 4410
SIGNAL = Signal(sample_rate=RATE, channels=2, string=load_string("prototype").string)


def alone(microphone: int, name: str = "fft_harmonic") -> Extractor:
    options = {"microphone": microphone, "feature": {"name": name}}
    return FEATURES.build("one_microphone", options).prepare(SIGNAL, SIZE)


def sounds() -> np.ndarray:
    time = np.arange(SIZE) / RATE
    lines = np.array([[2430.0], [1730.0]])
    both = 0.2 * np.sin(2.0 * np.pi * lines * time) + 0.03 * np.sin(2.0 * np.pi * lines[::-1] * time)
    return both[np.newaxis].astype(np.float32)


@pytest.mark.parametrize("microphone", [1, 2])
@pytest.mark.parametrize("name", ["fft_harmonic", "reading", "log_mel"])
def test_it_is_the_other_feature_of_a_copy(name: str, microphone: int) -> None:
    plain = FEATURES.build(name).prepare(SIGNAL, SIZE)
    both = sounds()
    copied = np.repeat(both[:, microphone - 1 : microphone], 2, axis=1)
    extract = alone(microphone, name)
    np.testing.assert_array_equal(extract(both), plain(copied))
    assert extract.columns == plain.columns
    other = both.copy()
    other[:, 2 - microphone] = np.random.default_rng(1).normal(size=SIZE)
    np.testing.assert_array_equal(extract(other), extract(both))


def test_differences_of_microphones_are_zero() -> None:
    extract = alone(1)
    row = extract(sounds())[0]
    differs = [column.startswith("difference string") for column in extract.columns]
    assert any(differs)
    assert np.abs(row[differs]).max() == 0.0
    both = FEATURES.build("fft_harmonic").prepare(SIGNAL, SIZE)(sounds())[0]
    assert np.abs(both[differs]).max() > 0.0


def test_bad_options_are_refused() -> None:
    mono = Signal(sample_rate=RATE, channels=1)
    with pytest.raises(InputError, match="microphone 2"):
        FEATURES.build("one_microphone", {"microphone": 2}).prepare(mono, SIZE)
    with pytest.raises(InputError, match="log_mal"):
        FEATURES.build("one_microphone", {"feature": {"name": "log_mal"}}).prepare(SIGNAL, SIZE)
    with pytest.raises(InputError, match="feature"):
        FEATURES.build("one_microphone", {"feature": {}}).prepare(SIGNAL, SIZE)
    with pytest.raises(InputError, match="microphone"):
        FEATURES.build("one_microphone", {"microphone": 3})
