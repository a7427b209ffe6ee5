"""Collect two simulated sessions, train a model on them, and hear a stretch of one as a stream.

Run it: python examples/train_a_model.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from monochord.core.types import Signal
from monochord.datasets.build import build_dataset
from monochord.datasets.split import split_dataset
from monochord.lab.offline import make
from monochord.lab.plan import assignments
from monochord.lab.plans import load_plan
from monochord.perception.model import load
from monochord.perception.training.replay import window_of
from monochord.perception.training.scores import lines
from monochord.perception.training.settings import Settings
from monochord.perception.training.train import train


def main() -> None:
    """Print what the validation part says of the model, and how far off it is on the test part."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sessions = [make(session, folder).path for session in assignments(load_plan("small"))]
        dataset = build_dataset(sessions, folder / "dataset")
        split = split_dataset(dataset, by="time", seed=1)
        split.write(dataset.path / "split.json")
        few = {"hidden": [32, 32, 32]}
        settings = Settings.read(
            {
                "dataset": str(dataset.path),
                "feature": {"name": "log_mel"},
                "context": {"on": False},
                "heads": {"contact": {}, "slip": {}, "position": few, "force": few},
                "optimiser": {"rate": 3e-3, "decay": 1e-2, "batch": 64, "epochs": 40},
            }
        )
        result = train(settings, folder / "run")
        print("simulated, on validation:", *lines(result.scores, settings.tasks()), sep="\n")

        listening = load(folder / "run").open(Signal(sample_rate=44100, channels=2))
        off: list[float] = []
        for row in split.test.tolist():
            told = listening.predict(window_of(dataset, row))["position"]
            if told.valid and dataset.label("contact")[row] == 1.0:
                off.append(told.value - float(dataset.label("position")[row]))
        print(f"test: {1e3 * np.mean(np.abs(off)):.1f} mm mean error in {len(off)} windows with a touch")


if __name__ == "__main__":
    main()
