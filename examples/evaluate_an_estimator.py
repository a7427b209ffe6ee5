"""Collect two simulated sessions, play them through an estimator, and score it in quiet and in noise.

Run it: python examples/evaluate_an_estimator.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import monochord as mc
from monochord.evaluation.noise import Disturbance
from monochord.evaluation.replay import Selection, replay
from monochord.metrics import finite_rows
from monochord.perception.estimators.closed_form import ClosedForm


def main() -> None:
    """Print the error of position in three conditions."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sessions = mc.collect("small", folder / "sessions")
        dataset = mc.build(sessions, folder / "dataset", split="time").dataset
        string = mc.load_sensor("prototype").string
        selection = Selection(dataset=dataset, rows=np.arange(len(dataset)), string=string)
        estimator = ClosedForm(tension_law="geometric")
        print(f"{'simulated':<12}{'answered':>10}{'mean error':>12}")
        for noise in (None, Disturbance(kind="hum", ratio=10.0), Disturbance(kind="white", ratio=20.0)):
            results = replay(selection, estimator, name="closed_form", disturbance=noise)
            touched = results.where(results.label("contact") == 1.0)
            truth, estimate = touched.label("position"), touched.estimate("position")
            answered = finite_rows(truth, estimate)
            error = 1e3 * mc.mean_absolute_error(truth[answered], estimate[answered])
            print(f"{results.trials[0].condition:<12}{answered.mean():>10.1%}{error:>9.2f} mm")


if __name__ == "__main__":
    main()
