"""Cross-validate position and force on the harmonics over touches, with scikit-learn.

Run it: python examples/study_a_feature.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from sklearn.linear_model import RidgeCV
from sklearn.model_selection import GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import monochord as mc
from monochord.datasets.build import build_dataset
from monochord.datasets.split import split_dataset
from monochord.lab.offline import make
from monochord.lab.plan import assignments
from monochord.lab.plans import load_plan


def main() -> None:
    """Print how well the harmonics determine position and force of touches that are not in the fit."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sessions = [make(session, folder).path for session in assignments(load_plan("small"))]
        dataset = build_dataset(sessions, folder / "dataset")
        split_dataset(dataset, by="time").write(dataset.path / "split.json")
        features, labels, _ = mc.load_dataset(dataset.path).arrays("fft_harmonic")
        contact = labels["contact"] == 1.0
        touch = np.cumsum(np.diff(contact, prepend=False) & contact)[contact]
        estimator = make_pipeline(StandardScaler(), RidgeCV(np.logspace(0.0, 6.0, 13)))
        for head in ("position", "force"):
            label = labels[head][contact]
            scores = cross_val_score(estimator, features[contact], label, groups=touch, cv=GroupKFold(4))
            print(f"{head}: R^2 {np.median(scores):.2f} (median of 4 folds of whole touches, simulated)")


if __name__ == "__main__":
    main()
