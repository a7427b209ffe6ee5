"""Folders of training runs: gone on with, drawn, evaluated."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from tests.fuzz.base import Input, Target, command, taken_from
from tests.fuzz.targets.models import drawn_model

from monochord.core.config import load_toml
from monochord.core.errors import InputError
from monochord.figures import FIGURES
from monochord.perception.training.checkpoint import Checkpoint
from monochord.perception.training.run_folder import CHECKPOINT, CONFIG, claim, write_history, write_metrics
from monochord.perception.training.settings import TrainingSettings

HISTORY = [
    {"epoch": float(n), "loss": 1.0 / n, "contact": 0.5 / n, "position": 0.01 / n} for n in range(1, 4)
]
SCORES = {
    "contact": {"accuracy": 0.9, "baseline_accuracy": 0.6},
    "position": {"mae": 0.001, "baseline_mae": 0.02},
}


class Fuzz(Target):
    """Settings, checkpoint, history, metrics and the model in one folder."""

    def seeds(self, folder: Path) -> Iterator[Input]:
        out = folder / "run"
        heads = {"contact": {}, "position": {}}
        claim(out, TrainingSettings.read({"title": "made", "dataset": "dataset", "heads": heads}).resolved())
        weights = {"contact.0.weight": np.ones((1, 4), np.float32)}
        Checkpoint(
            epoch=3, data="ab12", weights=weights, best=weights,
            moments={"0/step": np.array(7.0, np.float32)},
            score={"contact": 0.1}, at={"contact": 2}, history=HISTORY,
        ).write(out / CHECKPOINT)  # fmt: skip
        write_history(out, HISTORY)
        yield taken_from(out)
        write_metrics(out, {"simulated": True, "epochs": 3, "heads": SCORES})
        drawn_model(out / "model", heads=("contact", "position"))
        yield taken_from(out)

    def run(self, folder: Path) -> None:
        refused: list[InputError] = []

        def tried(what: object) -> None:
            try:
                what()  # pyright: ignore[reportCallIssue, reportUnknownVariableType]
            except InputError as error:
                refused.append(error)

        tried(lambda: Checkpoint.read(folder / CHECKPOINT))
        tried(lambda: claim(folder, load_toml(folder / CONFIG)))
        tried(lambda: FIGURES.build("learning", {"run": str(folder)}).draw())
        tried(lambda: command("evaluate", folder, "--json"))
        # Without its dataset no run can be evaluated.
        if len(refused) > 1:
            raise refused[0]
