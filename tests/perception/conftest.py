"""Training runs by one method each, and the model of a run with corrections."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.conftest import shared

from monochord.perception.model import Model
from monochord.perception.model.definition import Method

LessonBy = Callable[[Method], Path]


@pytest.fixture
def lesson_by(
    lesson: dict[str, Any], made_up_features: None, tmp_path_factory: pytest.TempPathFactory
) -> LessonBy:
    """Return the function from a method to the folder of a short run of `lesson` by it, to be read alone."""
    from monochord.perception.training.settings import TrainingSettings
    from monochord.perception.training.train import train

    def run_of(method: Method) -> Path:
        settings = {**lesson, "methods": [method], "optimiser": {"epochs": 4}}

        def fill(home: Path) -> None:
            train(TrainingSettings.read(settings), home / "run")

        return shared(tmp_path_factory, f"lesson_by_{method}", fill) / "run"

    return run_of


def with_corrections(model: Model, learnable: Path, bias: float) -> Model:
    """Return a model of `lesson` with corrections; its prior knows forces off by `bias` either way."""
    from monochord.datasets.split import Split
    from monochord.datasets.store import open_dataset
    from monochord.perception.training.correct import with_prior, with_variables
    from monochord.perception.training.examples import touches_of
    from monochord.perception.training.train import read_in_turn

    dataset, parts = open_dataset(learnable), Split.read(learnable / "split.json").parts
    model = replace(model, definition=with_variables(model.definition, {"position": (), "force": ()}))
    rows = np.sort(np.concatenate([parts["validation"], parts["test"]]))
    outputs = read_in_turn(model, dataset, rows).outputs
    force = dataset.label("force") + np.where(dataset.session % 2 == 0, bias, -bias)
    dataset = replace(dataset, labels={**dataset.labels, "force": force})
    for name in ("position", "force"):
        model = with_prior(model, name, dataset, outputs, touches_of(dataset))
    return model
