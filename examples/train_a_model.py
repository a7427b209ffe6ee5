"""Collect two simulated sessions, train a model on them, and estimate a part of one as a stream.

Run it: python examples/train_a_model.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from monochord.datasets.build import build_dataset
from monochord.datasets.split import split_dataset
from monochord.lab.offline import make
from monochord.lab.plan import assignments
from monochord.lab.plans import load_plan
from monochord.perception.model import ModelState, load
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import train, window_of


def main() -> None:
    """Print the errors of the model on the validation and the test part."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sessions = [make(session, folder).path for session in assignments(load_plan("small"))]
        dataset = build_dataset(sessions, folder / "dataset")
        split = split_dataset(dataset, by="time", seed=3)
        split.write(dataset.path / "split.json")
        settings = TrainingSettings.read(
            {"dataset": str(dataset.path), "optimiser": {"batch": 64, "epochs": 20, "decay": 1.0}}
        )
        result = train(settings, folder / "run")
        error = 1e3 * result.scores["position"]["mae"]
        print(f"simulated, on validation: {error:.1f} mm mean error of position")

        model, state = load(folder / "run"), ModelState()
        errors: list[float] = []
        for row in split.test.tolist():
            state, estimates = model.step(state, window_of(dataset, row))
            position = estimates["position"]
            if position.valid and dataset.label("contact")[row] == 1.0:
                errors.append(position.value - float(dataset.label("position")[row]))
        size = 1e3 * np.abs(errors)  # a misread place, of which a small training has some, is far off
        print(f"test: {np.median(size):.1f} mm median error in {len(errors)} windows with a touch")


if __name__ == "__main__":
    main()
