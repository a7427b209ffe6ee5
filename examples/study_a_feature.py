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


def main() -> None:
    """Print how well the harmonics determine position and force of touches that are not in the fit."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sessions = mc.collect("small", folder / "sessions")
        data = mc.build(sessions, folder / "dataset", split="time")
        features, labels, _ = data.arrays("fft_harmonic")
        contact = labels["contact"] == 1.0
        touch = np.cumsum(np.diff(contact, prepend=False) & contact)[contact]
        estimator = make_pipeline(StandardScaler(), RidgeCV(np.logspace(0.0, 6.0, 13)))
        for head in ("position", "force"):
            label = labels[head][contact]
            scores = cross_val_score(estimator, features[contact], label, groups=touch, cv=GroupKFold(4))
            print(f"{head}: R^2 {np.median(scores):.2f} (median of 4 folds of whole touches, simulated)")


if __name__ == "__main__":
    main()
