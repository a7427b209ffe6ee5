"""How good a model is on the windows that chose it, beside what the mean label would have scored."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.metrics import detection_score, mean_absolute_error, regression_score
from monochord.perception.heads.base import Task

Numbers = dict[str, float]


def chance_scores(reference: NDArray[np.bool_], probability: Floats) -> Numbers:
    """Return share of right answers, area under the curve, and the accuracy of the more frequent answer.

    >>> scores = chance_scores(np.array([True, False, False]), np.array([0.9, 0.2, 0.6]))
    >>> {name: round(value, 3) for name, value in scores.items()}
    {'windows': 3, 'accuracy': 0.667, 'auc': 1.0, 'baseline_accuracy': 0.667}
    """
    score = detection_score(reference, probability)
    return {
        "windows": score.windows,
        "accuracy": _number(score.accuracy),
        "auc": _number(score.area),
        "baseline_accuracy": _number(score.baseline),
    }


def amount_scores(reference: Floats, estimate: Floats, mean: float) -> Numbers:
    """Return mean absolute error, Pearson's r, and the error of `mean`, the mean label of the training.

    >>> amount_scores(np.array([1.0, 2.0]), np.array([1.0, 2.5]), 1.5)["baseline_mae"]
    0.5
    """
    score = regression_score(reference, estimate, limit=0.0)
    return {
        "windows": score.windows,
        "mae": _number(score.mae),
        "median_error": _number(score.median),
        "r": _number(score.r),
        "baseline_mae": mean_absolute_error(reference, np.full(len(reference), mean)),
    }


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def lines(scores: Mapping[str, Numbers], tasks: Mapping[str, Task]) -> list[str]:
    """Return scores by head as lines of text, with the units that a person reads."""
    found: list[str] = []
    for name, told in scores.items():
        count = f"{told['windows']:.0f} windows"
        if tasks[name].is_chance:
            said = f"{100 * told['accuracy']:.2f} % right, area under the curve {told['auc']:.4f}"
            found.append(
                f"  {name:<10} {said} ({count}; always the same: {100 * told['baseline_accuracy']:.1f} %)"
            )
            continue
        shown, unit = (1e3, "mm") if tasks[name].unit == "m" else (1.0, tasks[name].unit)
        error, mean = (f"{shown * told[key]:.3g} {unit}" for key in ("mae", "baseline_mae"))
        found.append(f"  {name:<10} mean error {error}, r {told['r']:.3f} ({count}; the mean label: {mean})")
    return found
