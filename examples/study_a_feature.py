"""Compare two features for one head by cross-validation over sessions, with scikit-learn.

Run it: python examples/study_a_feature.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from sklearn.model_selection import GroupKFold, cross_val_score

import monochord as mc
from monochord.datasets.build import build_dataset
from monochord.lab.offline import make
from monochord.lab.plan import assignments
from monochord.lab.plans import load_plan


def main() -> None:
    """Print how well each feature predicts the force of touches that are not in the fit."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sessions = [make(session, folder).path for session in assignments(load_plan("small"))]
        dataset = build_dataset(sessions, folder / "dataset")
        contact = dataset.label("contact")
        rows = np.flatnonzero(dataset.usable & (contact == 1.0))
        windows, force = dataset.batch(rows), dataset.label("force")[rows]
        touch = np.cumsum(np.diff(rows, prepend=0) > 1)  # a gap between touched windows ends a touch
        for feature in ("log_mel", "fft_harmonic"):
            estimator = mc.TouchEstimator("force", feature=feature)
            scores = cross_val_score(estimator, windows, force, groups=touch, cv=GroupKFold(5))
            print(f"{feature}: R^2 of the force {np.median(scores):.2f} (median of 5 folds, simulated)")


if __name__ == "__main__":
    main()
