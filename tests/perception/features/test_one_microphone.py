"""One microphone alone, and nothing of the other."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.conftest import LEARNABLE

from monochord.core.errors import InputError
from monochord.core.types import Estimates, Signal, Window
from monochord.perception.estimators.model import ModelEstimator
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import train
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
@pytest.mark.parametrize("name", ["fft_harmonic", "untouched", "closed_form", "log_mel"])
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
    with pytest.raises(InputError, match="microphone 2 of 1"):
        FEATURES.build("one_microphone", {"microphone": 2}).prepare(mono, SIZE)
    with pytest.raises(InputError, match="did you mean 'log_mel'"):
        FEATURES.build("one_microphone", {"feature": {"name": "log_mal"}}).prepare(SIGNAL, SIZE)
    with pytest.raises(InputError, match="without a name"):
        FEATURES.build("one_microphone", {"feature": {}}).prepare(SIGNAL, SIZE)
    with pytest.raises(InputError, match="microphone"):
        FEATURES.build("one_microphone", {"microphone": 3})


@pytest.mark.usefixtures("made_up_features")
def test_a_model_of_one_microphone_ignores_the_other(lesson: dict[str, Any], tmp_path: Path) -> None:
    pytest.importorskip("torch")
    alone = {"name": "one_microphone", "microphone": 2}
    lesson["feature"] = {**alone, "feature": {"name": "bands"}}
    lesson["context"] = {"feature": {**alone, "feature": {"name": "bands", "count": 4}}}
    lesson["optimiser"] = {**lesson["optimiser"], "epochs": 2}
    train(TrainingSettings.read(lesson), tmp_path / "run")
    noise = np.random.default_rng(0).normal(size=(2, 1600)).astype(np.float32)
    other = noise * np.array([[3.0], [1.0]], np.float32)
    estimates: list[Estimates] = []
    for samples in (0.1 * noise, 0.1 * other):
        window = Window(samples=samples, start=0, sample_rate=LEARNABLE)
        signal = Signal(sample_rate=LEARNABLE, channels=2)
        estimates.append(ModelEstimator(path=tmp_path / "run").prepare(signal, 1600)(window))
    assert str(estimates[0]) == str(estimates[1])  # NaN, where it abstains, is no number that equals itself
    assert estimates[0]["contact"].valid
