"""The linear path of a head: a robust ridge regression, solved in closed form.

Position and force are nearly linear in the features, and a closed-form solution is more accurate than
gradient steps. The hidden layers learn the residual. In training, each window's residual comes from a
solution without the window's session, so the residuals are as large as on new windows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Floats

PENALTIES = tuple(10.0**power for power in range(-6, 2))
"""Candidate ridge penalties, per window and standardised column."""
FOLDS = 5
ROUNDS = 4
"""Iterations with updated window weights; more change the errors on the plan `paper` by less than 1 %."""
HUBER = 1.5
"""Multiple of the median residual above which a residual counts linearly, not quadratically."""
MIN_RESIDUAL = 1e-4
"""Smallest scale of the residual, in standard deviations of the label."""

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearPath:
    """A ridge solution: estimate = row @ `weight` + `bias`, for scaled columns and a scaled label.

    `folds` holds the weight and bias of a solution without each fold, and `fold` (n,) is the fold of each
    training window. `residual` is the mean absolute residual of the training windows, each from the solution
    without its fold. `penalty` is the selected ridge penalty.
    """

    weight: Floats
    bias: float
    folds: tuple[tuple[Floats, float], ...]
    fold: Indices
    residual: float
    penalty: float


def solve(copies: Sequence[Audio], label: Floats, fold: Indices) -> LinearPath:
    """Return the ridge regression of a label on features, robust against outliers.

    It minimises ``sum_i w_i (y_i - x_i b - a)^2 / sum_i w_i + penalty |b|^2`` with Huber's weights ``w_i =
    min(1, s / |r_i|)``. The residual r_i of a window comes from the solution without the window's fold. The
    penalty is the candidate with the smallest residuals.

    Parameters
    ----------
    copies
        Features (n, d) of the windows for each copy, clean and augmented, in standard deviations.
    label
        Label (n,) of each window, in standard deviations.
    fold
        Fold (n,) of each window, from 0 on; all windows of a touch are in one fold.

    References
    ----------
    Huber (1964), Robust estimation of a location parameter; Hoerl and Kennard (1970), Ridge regression.

    Examples
    --------
    >>> rows = np.random.default_rng(0).normal(size=(200, 3)).astype(np.float32)
    >>> path = solve([rows], rows @ np.array([1.0, -2.0, 3.0]) + 0.5, np.arange(200) % 5)
    >>> np.round(path.weight, 2).tolist(), round(path.bias, 2)
    ([1.0, -2.0, 3.0], 0.5)
    """
    count = int(fold.max()) + 1
    weights = [np.ones(len(label)) for _ in copies]
    best: tuple[float, float, list[tuple[Floats, float]], tuple[Floats, float]] | None = None
    for _ in range(ROUNDS):
        moments = [_moments(copies, label, fold == k, weights) for k in range(count)]
        whole = np.sum(moments, axis=0)
        best = None
        for penalty in PENALTIES:
            folds = [_solution(whole - own if count > 1 else whole, penalty) for own in moments]
            error = np.concatenate(
                [w * np.abs(r) for w, r in zip(weights, _residuals(copies, label, fold, folds), strict=True)]
            )
            mean = float(error.sum() / max(sum(w.sum() for w in weights), 1e-12))
            if best is None or mean < best[0]:
                best = mean, penalty, folds, _solution(whole, penalty)
        assert best is not None
        residuals = _residuals(copies, label, fold, best[2])
        bound = HUBER * max(float(np.median(np.abs(np.concatenate(residuals)))), 1e-9)
        weights = [bound / np.maximum(np.abs(residual), bound) for residual in residuals]
    assert best is not None
    residuals = _residuals(copies, label, fold, best[2])
    return LinearPath(
        weight=best[3][0],
        bias=best[3][1],
        folds=tuple(best[2]),
        fold=fold,
        residual=max(float(np.mean(np.abs(np.concatenate(residuals)))), MIN_RESIDUAL),
        penalty=best[1],
    )


def folds_of(session: Indices, touch: Indices) -> Indices:
    """Return the fold (n,) of each window; folds are whole sessions if there are enough, else whole touches.

    >>> folds_of(np.zeros(4, int), np.array([3, 3, 8, 9])).tolist()
    [0, 0, 1, 2]
    """
    group = session if len(np.unique(session)) >= FOLDS else touch
    number = np.unique(group, return_inverse=True)[1].reshape(-1)
    if number.max() == 0:
        return np.arange(len(number)) * min(FOLDS, len(number)) // len(number)
    return (number % FOLDS).astype(np.int64)


def _moments(
    copies: Sequence[Audio], label: Floats, part: NDArray[np.bool_], weights: Sequence[Floats]
) -> Floats:
    """Return sum_i w_i z_i z_i^T with z = (x, 1, y), over the windows of a part and all copies."""
    total: Floats = np.zeros((copies[0].shape[1] + 2,) * 2)
    for rows, weight in zip(copies, weights, strict=True):
        extended = np.column_stack([rows[part].astype(np.float64), np.ones(part.sum()), label[part]])
        total += (extended * weight[part, None]).T @ extended
    return total


def _solution(moments: Floats, penalty: float) -> tuple[Floats, float]:
    """Return weight (d,) and bias of the ridge regression with these moments."""
    size = len(moments) - 2
    total = moments[size, size]
    if total <= 0.0:
        return np.zeros(size), 0.0
    mean, label = moments[:size, size] / total, moments[size, size + 1] / total
    covariance = moments[:size, :size] / total - np.outer(mean, mean)
    covariance[np.diag_indices(size)] += penalty
    weight = np.linalg.solve(covariance, moments[:size, size + 1] / total - mean * label)
    return weight, float(label - mean @ weight)


def _residuals(
    copies: Sequence[Audio], label: Floats, fold: Indices, folds: Sequence[tuple[Floats, float]]
) -> list[Floats]:
    """Return for each copy the residuals (n,), each by the solution of the window's fold."""
    matrix = np.stack([weight for weight, _ in folds]).astype(np.float32)
    bias = np.array([bias for _, bias in folds])
    at = np.arange(len(label))
    return [label - (rows @ matrix.T)[at, fold] - bias[fold] for rows in copies]
