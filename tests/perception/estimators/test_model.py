"""The learned estimator: live, bit for bit equal to what the dataset's windows give."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.perception.conftest import LessonBy
from tests.perception.windows import window_of

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.types import Signal
from monochord.datasets.store import open_dataset
from monochord.live import LiveRun
from monochord.live.loop import opened
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.model import ModelEstimator
from monochord.perception.model.definition import Method
from monochord.perception.training.settings import METHODS

pytest.importorskip("torch")
SIGNAL = Signal(sample_rate=16000, channels=2)
MADE_UP = Path(__file__).parents[2] / "made_up_features"


@pytest.mark.parametrize("method", ["network", "extra_trees"])
def test_live_is_offline_to_the_bit(lesson_by: LessonBy, method: Method, learnable: Path) -> None:
    dataset, path, estimates = open_dataset(learnable), str(lesson_by(method)), list[str]()
    session = learnable.parent / f"{dataset.manifest.parts[0].name}.mcap"
    setup = LiveRun.read(
        {
            "source": {"name": "session", "path": str(session), "block": 3001},
            "estimator": {"name": "model", "path": path},
            "window": {"length": 0.1, "hop": 0.1},
            "sinks": {},
        }
    )
    with opened(setup) as live:
        estimates += [str(dict(update.prediction.estimates)) for update in live]
    estimate = ESTIMATORS.build("model", {"path": path}).prepare(SIGNAL, 1600)
    rows = np.flatnonzero(dataset.session == 0)
    assert estimates == [str(dict(estimate(window_of(dataset, row)))) for row in rows.tolist()]
    assert len(rows) == 240


def test_what_it_was_not_trained_on_is_refused_before_any_window_comes(
    lesson_by: LessonBy, tmp_path: Path
) -> None:
    estimator = from_tree(ModelEstimator, {"path": str(lesson_by("ridge"))})
    with pytest.raises(InputError, match=r"400 frames.*1600 frames"):
        estimator.prepare(SIGNAL, 400)
    with pytest.raises(InputError, match=r"48000 Hz.*16000 Hz"):
        estimator.prepare(dataclasses.replace(SIGNAL, sample_rate=48000), 4800)
    with pytest.raises(InputError, match=r"model\.json"):
        ModelEstimator(path=tmp_path).prepare(SIGNAL, 1600)


def test_prediction_needs_no_torch(lesson_by: LessonBy, learnable: Path) -> None:
    code = f"""
import sys
from monochord.perception import features
features.__path__.append({str(MADE_UP)!r})
from pathlib import Path
from monochord.datasets.store import open_dataset
from monochord.perception.model import ModelState, load
from monochord.core.types import Window
window = Window(samples=open_dataset(Path({str(learnable)!r})).window(15).copy(), start=0, sample_rate=16000)
for path in {[str(lesson_by(method)) for method in METHODS]!r}:
    assert load(path).step(ModelState(), window)[1]["contact"].valid
print(sorted({{"torch", "matplotlib", "pyarrow", "sklearn"}} & set(sys.modules)))
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"
