"""Ridge regression and extra trees: heads of a model, and the baselines of an evaluation.

Both need neither epochs nor PyTorch. What they learn is one linear layer in the form of a network's last one,
and for extra trees a forest that adds to its first output; see `monochord.perception.model.network`.

A learned standard error, the second output, is linear in the inputs: ridge regression of the logarithm of the
errors on left-out windows (Harvey, Estimating regression models with multiplicative heteroscedasticity,
Econometrica, 1976). Windows are left out by whole sessions where there are several, else by whole touches,
since the windows of one touch are nearly equal.

Ridge regression needs the sums of products of its inputs and its target alone, so windows are read block by
block, and any number of them takes the same memory. A logistic regression and trees learn from a draw.
"""

import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Flags, Floats, Indices
from monochord.perception.heads.base import REFINED_SCALE, RIGHT_WITHIN, Task
from monochord.perception.model.definition import Method
from monochord.perception.model.forest import NO_FOREST, forest_of, forest_sums

MAX_TREES, MAX_LOGISTIC = 10_000, 40_000
"""Most windows that trees and a logistic regression learn from, spread evenly: half a minute of computing."""
BLOCK = 2048
"""Number of windows of an array in a block."""
FOLDS = 5
"""Number of parts that are left out in turn."""
STRENGTHS: Floats = np.logspace(-3.0, 5.0, 9)
"""Ridge's penalties of the squared weights; the one with the smallest error on left-out windows is used."""
SURE = 4.0
"""Log odds of a class, of which trees learn the mean."""
MIN_ERROR = 1e-6
"""Smallest error whose logarithm is taken, in units of the head's scale."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedRegression:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class RegressionWindows:
    """Windows to learn from, in memory block by block.

    `blocks` returns an iterator over the numbers (m,) of some windows and their scaled inputs (m, k).
    `target` (n,) holds the labels: 0 or 1, or the quantity in units of the head's scale. `group` (n,) is the
    number of the part to which each window belongs; windows are left out by whole parts.
    """

    blocks: Callable[[], Iterable[tuple[Indices, Audio | Floats]]]
    target: Floats
    group: Indices

    @classmethod
    def of(cls, inputs: Audio | Floats, target: Floats, group: Indices) -> "RegressionWindows":
        """Return windows whose inputs (n, k) are in memory."""

        def blocks() -> Iterator[tuple[Indices, Audio | Floats]]:
            for first in range(0, len(target), BLOCK):
                some = inputs[first : first + BLOCK]
                yield np.arange(first, first + len(some)), some

        return cls(blocks=blocks, target=target.astype(np.float64), group=group)

    def only(self, chosen: Flags) -> "RegressionWindows":
        """Return some of the windows."""
        if chosen.all():
            return self
        place = np.cumsum(chosen) - 1

        def blocks() -> Iterator[tuple[Indices, Audio | Floats]]:
            for numbers, inputs in self.blocks():
                some = chosen[numbers]
                yield place[numbers[some]], inputs[some]

        return RegressionWindows(blocks=blocks, target=self.target[chosen], group=self.group[chosen])

    def drawn(self, most: int) -> tuple[Floats, "RegressionWindows"]:
        """Return the inputs (m, k) of at most `most` windows, spread evenly, and these windows in memory."""
        chosen = np.zeros(len(self.target), bool)
        chosen[:: max(1, -(-len(chosen) // most))] = True
        some, rows = self.only(chosen), np.zeros((0, 0))
        for numbers, inputs in some.blocks():
            rows = rows if rows.size else np.empty((len(some.target), inputs.shape[1]))
            rows[numbers] = inputs
        return rows, RegressionWindows.of(rows, some.target, some.group)


def fit_regression(method: Method, task: Task, windows: RegressionWindows) -> FittedRegression:
    """Return what a method, "ridge" or "extra_trees", learns of a head's task from windows that count for it.

    Loss and `refines` of the task say which outputs there are.

    >>> rng = np.random.default_rng(0)
    >>> inputs = rng.normal(size=(200, 2)).astype(np.float32)
    >>> task = Task(label="force", unit="N", loss="laplace")
    >>> windows = RegressionWindows.of(inputs, 3.0 * inputs[:, 0], np.arange(200))
    >>> learned = fit_regression("ridge", task, windows)
    >>> learned.weight.shape, round(float(learned.weight[0, 0]), 1)
    ((2, 2), 3.0)
    """
    if method == "extra_trees":
        windows = windows.drawn(MAX_TREES)[1]
    if task.is_probability:
        rows, some = windows.drawn(MAX_LOGISTIC)
        if method == "extra_trees":
            return _trees(rows, SURE * (2.0 * some.target - 1.0), 1)
        return _linear(*_logistic(rows, some.target))
    right = np.abs(windows.target) < RIGHT_WITHIN / REFINED_SCALE
    right = right if task.refines else np.ones(len(right), bool)
    known = windows.only(right if right.any() else ~right)
    if method == "extra_trees":
        inputs, _ = known.drawn(MAX_TREES)
        result = _trees(inputs, known.target, task.outputs)
        estimate = _left_out(inputs, known.target, known.group) if task.outputs > 1 else known.target
    else:
        ridge = _Ridge.of(known)
        result = _linear(*ridge.layer, task.outputs)
        estimate = ridge.left_out(known) if task.outputs > 1 else known.target
    if task.outputs > 1:
        result.weight[1], result.bias[1] = _log_spread(task, known, np.abs(estimate - known.target))
    return result


def groups_of(session: Indices, touch: Indices) -> Indices:
    """Return the parts by which windows (n,) are left out: sessions if there are several, else touches.

    >>> groups_of(np.array([0, 0, 0]), np.array([1, 1, 2])).tolist()
    [1, 1, 2]
    """
    return session if len(np.unique(session)) >= FOLDS else touch


def _linear(weight: Floats, bias: float, outputs: int = 1) -> FittedRegression:
    weights, biases = np.zeros((outputs, len(weight)), np.float32), np.zeros(outputs, np.float32)
    weights[0], biases[0] = weight, bias
    return FittedRegression(weight=weights, bias=biases)


def _trees(rows: Floats, target: Floats, outputs: int) -> FittedRegression:
    flat = _linear(np.zeros(rows.shape[1]), 0.0, outputs)
    return FittedRegression(weight=flat.weight, bias=flat.bias, forest=forest_of(rows, target))


def _logistic(rows: Floats, target: Floats) -> tuple[Floats, float]:
    from sklearn.exceptions import ConvergenceWarning  # noqa: PLC0415
    from sklearn.linear_model import LogisticRegression  # noqa: PLC0415

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        fitted = LogisticRegression(max_iter=300).fit(rows, target)
    return fitted.coef_[0], float(fitted.intercept_[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ridge:
    """Penalised least squares: its layer, those without each part, and the part (n,) of each window.

    The penalty is that of the smallest squared error on left-out windows (Hoerl and Kennard, Ridge
    regression: biased estimation for nonorthogonal problems, Technometrics, 1970).
    """

    layer: tuple[Floats, float]
    others: list[tuple[Floats, float]]
    part: NDArray[np.int8]

    @classmethod
    def of(cls, windows: RegressionWindows) -> "_Ridge":
        """Return what is learned of the windows, from the sums of products in each part."""
        part, count = _parts(windows.group)
        sums: Floats = np.zeros((count, 1, 1))
        for numbers, inputs in windows.blocks():
            rows = np.column_stack([inputs, windows.target[numbers], np.ones(len(inputs))]).astype(np.float64)
            if sums.shape[1] != rows.shape[1]:
                sums = np.zeros((count, rows.shape[1], rows.shape[1]))
            for number in range(count):
                fold_rows = rows[part[numbers] == number]
                sums[number] += fold_rows.T @ fold_rows
        whole = sums.sum(axis=0)
        paths = [_paths(whole - fold_sum) for fold_sum in sums] if count > 1 else []
        errors = np.zeros(len(STRENGTHS))
        for fold_sum, (weights, biases) in zip(sums, paths, strict=False):
            residual = np.vstack([weights, np.full(len(STRENGTHS), -1.0), biases])
            errors += np.einsum("is,ij,js->s", residual, fold_sum, residual, optimize=True)
        best = int(errors.argmin())
        layers = [(weights[:, best], float(biases[best])) for weights, biases in (*paths, _paths(whole))]
        return cls(layer=layers[-1], others=layers[:-1], part=part)

    def left_out(self, windows: RegressionWindows) -> Floats:
        """Return the estimates (n,) of windows by those of the other parts; with one part, the mean."""
        estimate = np.full(len(windows.target), windows.target.mean())
        for numbers, inputs in windows.blocks() if self.others else ():
            for number, (weight, bias) in enumerate(self.others):
                in_fold = self.part[numbers] == number
                estimate[numbers[in_fold]] = inputs[in_fold].astype(np.float64) @ weight + bias
        return estimate


def _paths(sums: Floats) -> tuple[Floats, Floats]:
    """Return the weights (k, strengths) and biases (strengths,) for each penalty.

    `sums` (k + 2, k + 2) are the sums of products of the inputs, the target and 1 over all windows.
    """
    centre = sums[-1, :-1] / sums[-1, -1]
    about = sums[:-1, :-1] - sums[-1, -1] * np.outer(centre, centre)
    powers, axes = np.linalg.eigh(about[:-1, :-1])
    along = axes.T @ about[:-1, -1]
    weights = axes @ (along[:, np.newaxis] / (np.maximum(powers, 0.0)[:, np.newaxis] + STRENGTHS))
    return weights, centre[-1] - centre[:-1] @ weights


def _parts(group: Indices, count: int = FOLDS) -> tuple[NDArray[np.int8], int]:
    """Return the part (n,) in which each window is left out, and the number of parts.

    Parts are of whole groups, or of single windows of one group. With a single window there is one part.
    """
    names = np.unique(group)
    number = np.searchsorted(names, group) * count // len(names) if len(names) > 1 else np.arange(len(group))
    present, part = np.unique(number % count, return_inverse=True)
    return part.astype(np.int8), len(present)


def _left_out(rows: Floats, target: Floats, group: Indices) -> Floats:
    """Return what trees estimate of windows (n,) from the other half."""
    estimate = np.full(len(target), target.mean())
    part, count = _parts(group, 2)
    for number in range(count if count > 1 else 0):
        out = part == number
        estimate[out] = forest_sums(rows[out], forest_of(rows[~out], target[~out]))
    return estimate


def _log_spread(task: Task, windows: RegressionWindows, error: Floats) -> tuple[Floats, float]:
    """Return weights and bias of the logarithm of the spread of errors (n,), for the task's distribution."""
    logs = np.log(np.maximum(error, MIN_ERROR))
    weight, bias = _Ridge.of(replace(windows, target=logs)).layer
    power, total = 1.0 if task.loss == "laplace" else 2.0, 0.0
    for numbers, inputs in windows.blocks():
        ratio = logs[numbers] - inputs.astype(np.float64) @ weight - bias
        total += float(np.exp(power * ratio).sum())
    return weight, bias + float(np.log(total / len(logs))) / power
