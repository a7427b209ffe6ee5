"""Collect two simulated sessions, train a model on them, and estimate a part of one as a stream.

Run it: python examples/train_a_model.py
"""

from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import monochord as mc
from monochord.datasets import heard
from monochord.perception.model import ModelState


def main() -> None:
    """Print the errors of the model on the validation and the test part."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sessions = mc.collect("small", folder / "sessions")
        data = mc.build(sessions, folder / "dataset", split="time", seed=3)
        settings = ["optimiser.batch=64", "optimiser.epochs=20", "optimiser.decay=1.0"]
        model = mc.train(data, folder / "run", settings=settings)
        error = 1e3 * model.scores["position"]["mae"]
        print(f"simulated, on validation: {error:.2f} mm mean error of position")

        dataset, errors = data.dataset, list[float]()
        for _, rows in groupby(data.split.test.tolist(), dataset.session.__getitem__):
            state = ModelState()  # each session is a stream of its own
            for row, window in heard(dataset, rows):
                state, estimates = model.step(state, window)
                position = estimates["position"]
                if position.valid and dataset.label("contact")[row] == 1.0:
                    errors.append(position.value - float(dataset.label("position")[row]))
        size = 1e3 * np.abs(errors)  # a misread place, of which a small training has some, is far off
        print(f"test: {np.median(size):.2f} mm median error in {len(errors)} windows with a touch")


if __name__ == "__main__":
    main()
