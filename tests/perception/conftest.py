"""Training runs by one method each, which tests of the training and of the estimator read."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.conftest import shared

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
