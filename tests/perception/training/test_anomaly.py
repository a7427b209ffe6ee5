"""The detector of unlike sound: learned from faults made of ordinary windows, and from other sessions."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.datasets.faults import FAULTS, Fault
from monochord.datasets.split import Split
from monochord.datasets.store import open_dataset
from monochord.perception.model import Model, ModelState, load
from monochord.perception.model.definition import DETECTOR
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import train, window_of

pytest.importorskip("torch")
pytestmark = pytest.mark.usefixtures("made_up_features")
SHORT = {"epochs": 2, "batch": 64}


def reasons(model: Model, dataset: Path, fault: str = "") -> list[str]:
    """Return why a model abstains from contact in each test window, empty where it does not."""
    data = open_dataset(dataset)
    result, state = list[str](), ModelState()
    for row in Split.read(dataset / "split.json").test.tolist():
        window = window_of(data, row)
        if fault:
            add, rate = Fault(kind=fault), window.sample_rate
            spoilt: Audio = add(window.samples[None], [row], seed=5, sample_rate=rate)[0]
            window = dataclasses.replace(window, samples=spoilt)
        state, estimates = model.step(state, window)
        result.append(estimates["contact"].reason)
    return result


def test_faults_are_flagged_and_ordinary_windows_are_not(lesson: dict[str, Any], tmp_path: Path) -> None:
    out = tmp_path / "run"
    train(TrainingSettings.read({**lesson, "optimiser": SHORT, "known": {"on": True}}), out)
    model, dataset = load(out), Path(lesson["dataset"])
    assert np.mean([bool(each) for each in reasons(model, dataset)]) < 0.05
    for number in (1, 2):
        found = reasons(model, dataset, f"microphone {number} dead")
        assert np.mean([each == f"microphone {number} is silent" for each in found]) > 0.95
    measured = json.loads((out / "metrics.json").read_text())["known"]
    assert set(measured) == {"ordinary", *FAULTS}
    assert measured["ordinary"] <= 0.01


def test_other_sessions_are_learned_and_nothing_else_changes(lesson: dict[str, Any], tmp_path: Path) -> None:
    known = {"on": True, "dataset": lesson["dataset"], "reasons": {"sung_1*": "another string"}, "epochs": 2}
    known["touches"] = ["sung_1*"]
    plain, with_it = tmp_path / "plain", tmp_path / "known"
    train(TrainingSettings.read({**lesson, "optimiser": SHORT}), plain)
    train(TrainingSettings.read({**lesson, "optimiser": SHORT, "known": known}), with_it)
    one, other = load(plain), load(with_it)
    assert other.definition.known is not None
    assert "another string" in other.definition.known.reasons
    assert other.definition.known.touched == ("another string",)
    assert {name for name in other.weights if name.startswith(DETECTOR)} == set(other.weights) - set(
        one.weights
    )
    for name, array in one.weights.items():
        np.testing.assert_array_equal(array, other.weights[name])


def test_a_dataset_without_the_reasons_is_refused(lesson: dict[str, Any], tmp_path: Path) -> None:
    known = {"on": True, "dataset": lesson["dataset"], "reasons": {"foam_*": "soft"}}
    settings = TrainingSettings.read({**lesson, "optimiser": SHORT, "known": known})
    with pytest.raises(InputError, match="foam_"):
        train(settings, tmp_path / "run")


@pytest.mark.parametrize(
    "known",
    [{"share": 0.7}, {"epochs": 0}, {"faults": {"mice": "x"}}, {"on": True, "faults": {}}],
)
def test_settings_that_cannot_be(lesson: dict[str, Any], known: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="known"):
        TrainingSettings.read({**lesson, "known": known})
