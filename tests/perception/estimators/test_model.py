"""The learned estimator: live, bit for bit equal to what the dataset's windows give."""

import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.conftest import LESSON

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.types import Signal
from monochord.datasets.store import open_dataset
from monochord.live import LiveRun, run
from monochord.live.sinks.base import Listener, Update
from monochord.perception import features
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.model import ModelEstimator
from monochord.perception.training.settings import METHODS, TrainingSettings
from monochord.perception.training.train import train, window_of

pytest.importorskip("torch")
pytestmark = pytest.mark.usefixtures("made_up_features")
SIGNAL = Signal(sample_rate=16000, channels=2)
MADE_UP = Path(__file__).parents[2] / "made_up_features"
SESSIONS = (0, 3)


@pytest.fixture(scope="module", params=METHODS)
def trained(
    learnable: Path, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Path:
    home = tmp_path_factory.mktemp("trained")
    lesson = {**LESSON, "dataset": str(learnable), "cache": str(learnable.parent / "features")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(features, "__path__", [*features.__path__, str(MADE_UP)])
        train(
            TrainingSettings.read({**lesson, "methods": [request.param], "optimiser": {"epochs": 4}}),
            home / "run",
        )
    return home / "run"


@pytest.fixture(scope="module")
def offline(trained: Path, learnable: Path) -> list[str]:
    """The estimates of all windows of two sessions, read from the dataset."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(features, "__path__", [*features.__path__, str(MADE_UP)])
        estimate = ESTIMATORS.build("model", {"path": str(trained)}).prepare(SIGNAL, 1600)
    dataset = open_dataset(learnable)
    rows = np.flatnonzero(np.isin(dataset.session, SESSIONS))
    return [str(dict(estimate(window_of(dataset, row)))) for row in rows.tolist()]


class Recorder(Listener):
    """Keeps the estimates."""

    def __init__(self) -> None:
        self.estimates: list[str] = []

    def write(self, update: Update) -> None:
        self.estimates.append(str(dict(update.prediction.estimates)))


@pytest.mark.parametrize("block", [pytest.param(512, marks=pytest.mark.slow), 3001])
def test_live_is_offline_to_the_bit(trained: Path, learnable: Path, offline: list[str], block: int) -> None:
    dataset, recorder = open_dataset(learnable), Recorder()
    for number in SESSIONS:
        name = dataset.manifest.parts[number].name
        live = LiveRun.read(
            {
                "source": {"name": "session", "path": str(learnable.parent / f"{name}.mcap"), "block": block},
                "estimator": {"name": "model", "path": str(trained)},
                "window": {"length": 0.1, "hop": 0.1},
                "sinks": {},
            }
        )
        run(from_sinks(live, recorder))
    assert recorder.estimates == offline
    assert len(offline) == 480


def from_sinks(live: Any, sink: Listener) -> Any:
    return dataclasses.replace(live, sinks=(sink,))


def test_what_it_was_not_trained_on_is_refused_before_any_window_comes(trained: Path, tmp_path: Path) -> None:
    estimator = from_tree(ModelEstimator, {"path": str(trained)})
    with pytest.raises(InputError, match=r"400 frames.*1600 frames"):
        estimator.prepare(SIGNAL, 400)
    with pytest.raises(InputError, match=r"48000 Hz.*16000 Hz"):
        estimator.prepare(dataclasses.replace(SIGNAL, sample_rate=48000), 4800)
    with pytest.raises(InputError, match=r"model\.json"):
        ModelEstimator(path=tmp_path).prepare(SIGNAL, 1600)


def test_prediction_needs_no_torch(trained: Path, learnable: Path) -> None:
    code = f"""
import sys
from monochord.perception import features
features.__path__.append({str(MADE_UP)!r})
import dataclasses
from pathlib import Path
from monochord.datasets.store import open_dataset
from monochord.perception.model import ModelState, load
from monochord.core.types import Window
model = load({str(trained)!r})
window = Window(samples=open_dataset(Path({str(learnable)!r})).window(15).copy(), start=0, sample_rate=16000)
assert model.step(ModelState(), window)[1]["contact"].valid
print(sorted({{"torch", "matplotlib", "pyarrow", "sklearn"}} & set(sys.modules)))
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"
