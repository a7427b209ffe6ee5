"""Ridge regression and extra trees: heads of a model, and the baselines of an evaluation.

Both need neither epochs nor PyTorch. What they learn is one linear layer in the form of a network's last one,
and for extra trees a forest that adds to its first output; see `monochord.perception.model.network`.

A learned standard error, the second output, is linear in the inputs: ridge regression of the logarithm of the
errors on left-out windows (Harvey, Estimating regression models with multiplicative heteroscedasticity,
Econometrica, 1976). Windows are left out by whole sessions where there are several, else by whole touches,
since the windows of one touch are nearly equal.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from monochord.core.types import Audio, Flags, Floats, Indices
from monochord.perception.heads.base import REFINED_SCALE, RIGHT_WITHIN, Task
from monochord.perception.model.definition import Method
from monochord.perception.model.forest import NO_FOREST, forest_of, forest_sums

MAX_WINDOWS: Mapping[Method, int] = {"ridge": 40_000, "extra_trees": 10_000}
"""Most windows that each method learns from, spread evenly: half a minute of computing."""
FOLDS = 5
"""Number of parts that are left out in turn."""
STRENGTHS: Floats = np.logspace(-3.0, 5.0, 9)
"""Ridge's penalties of the squared weights; the one with the smallest error on left-out windows is used."""
SURE = 4.0
"""Log odds of a class, of which trees learn the mean."""
LIKELY_RIGHT = 4.0
"""Log odds that a refined position is right before training tells otherwise, or where all of it are right."""
MIN_ERROR = 1e-6
"""Smallest error whose logarithm is taken, in units of the head's scale."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Regression:
    """One linear layer, and the trees that add to its first output.

    `weight` (outputs, inputs) and `bias` (outputs,) are float32; `forest` (n, 3) are nodes, see
    `monochord.perception.model.forest`.
    """

    weight: Audio
    bias: Audio
    forest: Audio = field(default_factory=lambda: NO_FOREST)

    def first(self, inputs: Floats | Audio) -> Floats:
        """Return the first output (n,) for inputs (n, k): a scaled quantity, or a logit."""
        rows = inputs.astype(np.float64)
        return rows @ self.weight[0].astype(np.float64) + float(self.bias[0]) + forest_sums(rows, self.forest)


def fit_regression(method: Method, task: Task, inputs: Audio, target: Floats, group: Indices) -> Regression:
    """Return what ridge regression or extra trees learn of a head's task.

    Parameters
    ----------
    method
        "ridge" or "extra_trees".
    task
        The head's task, of which loss and `refines` give the outputs.
    inputs
        Scaled inputs (n, k) of the windows that count for the head.
    target
        Labels (n,): 0 or 1, or the quantity in units of the head's scale.
    group
        Number (n,) of the part to which each window belongs; windows are left out by whole parts.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> inputs = rng.normal(size=(200, 2)).astype(np.float32)
    >>> task = Task(label="force", unit="N", loss="laplace")
    >>> learned = fit_regression("ridge", task, inputs, 3.0 * inputs[:, 0], np.arange(200))
    >>> learned.weight.shape, round(float(learned.weight[0, 0]), 1)
    ((2, 2), 3.0)
    """
    step = max(1, -(-len(target) // MAX_WINDOWS[method]))
    rows, target, group = inputs[::step].astype(np.float64), target[::step].astype(np.float64), group[::step]
    if task.is_probability:
        if method == "extra_trees":
            return _trees(rows, SURE * (2.0 * target - 1.0), 1)
        weight, bias = _logistic(rows, target)
        return _linear(weight, bias)
    right = np.abs(target) < RIGHT_WITHIN / REFINED_SCALE if task.refines else np.ones(len(target), bool)
    known = right if right.any() else ~right
    own, wanted, part = rows[known], target[known], group[known]
    if method == "extra_trees":
        result = _trees(own, wanted, task.outputs)
        estimate = _left_out(own, wanted, part) if task.outputs > 1 else wanted
    else:
        weight, bias, estimate = _ridge(own, wanted, part)
        result = _linear(weight, bias, task.outputs)
    if task.outputs > 1:
        result.weight[1], result.bias[1] = _log_spread(task, own, np.abs(estimate - wanted), part)
    if task.refines:
        result.weight[2], result.bias[2] = _certainty(rows, right)
    return result


def groups_of(session: Indices, touch: Indices) -> Indices:
    """Return the parts by which windows (n,) are left out: sessions if there are several, else touches.

    >>> groups_of(np.array([0, 0, 0]), np.array([1, 1, 2])).tolist()
    [1, 1, 2]
    """
    return session if len(np.unique(session)) >= FOLDS else touch


def _linear(weight: Floats, bias: float, outputs: int = 1) -> Regression:
    weights, biases = np.zeros((outputs, len(weight)), np.float32), np.zeros(outputs, np.float32)
    weights[0], biases[0] = weight, bias
    return Regression(weight=weights, bias=biases)


def _trees(rows: Floats, target: Floats, outputs: int) -> Regression:
    flat = _linear(np.zeros(rows.shape[1]), 0.0, outputs)
    return Regression(weight=flat.weight, bias=flat.bias, forest=forest_of(rows, target))


def _logistic(rows: Floats, target: Floats) -> tuple[Floats, float]:
    from sklearn.exceptions import ConvergenceWarning  # noqa: PLC0415
    from sklearn.linear_model import LogisticRegression  # noqa: PLC0415

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        fitted = LogisticRegression(max_iter=300).fit(rows, target)
    return fitted.coef_[0], float(fitted.intercept_[0])


def _certainty(rows: Floats, right: Flags) -> tuple[Floats, float]:
    """Return weights and bias of the log odds that a position is right."""
    if right.all() or not right.any():
        return np.zeros(rows.shape[1]), LIKELY_RIGHT
    return _logistic(rows, right.astype(np.float64))


def _ridge(rows: Floats, target: Floats, group: Indices) -> tuple[Floats, float, Floats]:
    """Return weights and bias of penalised least squares, and the estimates (n,) of windows by the others.

    The penalty is that of the smallest squared error on left-out windows (Hoerl and Kennard, Ridge
    regression: biased estimation for nonorthogonal problems, Technometrics, 1970).
    """
    estimates = np.full((len(target), len(STRENGTHS)), target.mean())
    for out in _folds(group):
        weights, biases = _paths(rows[~out], target[~out])
        estimates[out] = rows[out] @ weights + biases
    best = int(np.square(estimates - target[:, np.newaxis]).sum(axis=0).argmin())
    weights, biases = _paths(rows, target)
    return weights[:, best], float(biases[best]), estimates[:, best]


def _paths(rows: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Return the weights (k, strengths) and biases (strengths,) for each penalty."""
    centre, mean = rows.mean(axis=0), target.mean()
    off = rows - centre
    powers, axes = np.linalg.eigh(off.T @ off)
    along = axes.T @ (off.T @ (target - mean))
    weights = axes @ (along[:, np.newaxis] / (np.maximum(powers, 0.0)[:, np.newaxis] + STRENGTHS))
    return weights, mean - centre @ weights


def _folds(group: Indices, count: int = FOLDS) -> list[Flags]:
    """Return the windows (n,) of each part that is left out: whole groups, or single windows of one."""
    names = np.unique(group)
    number = np.searchsorted(names, group) * count // len(names) if len(names) > 1 else np.arange(len(group))
    parts = [number % count == at for at in range(count)]
    return [part for part in parts if part.any() and not part.all()]


def _left_out(rows: Floats, target: Floats, group: Indices) -> Floats:
    """Return what trees estimate of windows (n,) from the other half."""
    estimate = np.full(len(target), target.mean())
    for out in _folds(group, 2):
        estimate[out] = forest_sums(rows[out], forest_of(rows[~out], target[~out]))
    return estimate


def _log_spread(task: Task, rows: Floats, error: Floats, group: Indices) -> tuple[Floats, float]:
    """Return weights and bias of the logarithm of the spread of errors (n,), for the task's distribution."""
    logs = np.log(np.maximum(error, MIN_ERROR))
    weight, bias, _ = _ridge(rows, logs, group)
    ratio = np.exp(logs - rows @ weight - bias)
    mean = ratio.mean() if task.loss == "laplace" else np.sqrt(np.square(ratio).mean())
    return weight, bias + float(np.log(mean))
