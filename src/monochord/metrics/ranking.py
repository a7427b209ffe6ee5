"""How well a number separates two classes: the area under the ROC curve."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats

Groups = list[Floats]
"""Values of one class, one array for each independent run."""


def area_under_curve(positive: Floats, negative: Floats) -> float:
    """Return the probability that a positive value exceeds a negative one; a tie counts one half.

    It is the area under the ROC curve, computed by ranks: A = (R - m (m + 1) / 2) / (m n), with R the sum of
    the positive values' mean ranks among all m + n.

    Parameters
    ----------
    positive, negative
        Values of both classes, (m,) and (n,), in any unit.

    Raises
    ------
    InputError
        If a class is empty, or a value is not finite.

    References
    ----------
    Hanley and McNeil (1982), The meaning and use of the area under a receiver operating characteristic (ROC)
    curve, Radiology 143, 29.

    Examples
    --------
    >>> area_under_curve(np.array([2.0, 3.0]), np.array([1.0, 2.0]))
    0.875
    """
    values = np.concatenate([positive, negative]).astype(np.float64)
    if positive.size == 0 or negative.size == 0 or np.isnan(values).any():
        raise InputError(f"{positive.size} positive and {negative.size} negative values", "values of both")
    _, where, counts = np.unique(values, return_inverse=True, return_counts=True)
    ranks = np.cumsum(counts) - 0.5 * (counts - 1)
    above = ranks[where[: positive.size]].sum() - 0.5 * positive.size * (positive.size + 1)
    return float(above / (positive.size * negative.size))


def area_interval(
    positive: Groups, negative: Groups, *, seed: int, draws: int = 400, share: float = 0.95
) -> tuple[float, float]:
    """Return the confidence interval of the area under the curve, by resampling whole runs with replacement.

    Windows of one run are similar, so whole runs are drawn (a cluster bootstrap). Both lists hold the same
    runs in the same order, and each draw uses the same runs from both. A run drawn twice is compared with
    itself too often; the resulting bias of the mean area is subtracted from the interval.

    Parameters
    ----------
    positive, negative
        Values of both classes by run; a run may have none of one class.
    seed
        Random seed.
    draws
        Number of draws.
    share
        Share of the draws inside the interval.

    Raises
    ------
    InputError
        If the lists differ in length, or are empty.

    References
    ----------
    Davison and Hinkley (1997), Bootstrap methods and their application, section 3.8.

    Examples
    --------
    >>> area_interval([np.array([2.0])] * 3, [np.array([1.0])] * 3, seed=0)
    (1.0, 1.0)
    """
    if len(positive) != len(negative) or not positive:
        raise InputError(
            f"{len(positive)} and {len(negative)} runs", "the same runs for both classes, at least one"
        )
    stream = np.random.default_rng(seed)
    areas: list[float] = []
    for _ in range(draws):
        runs = stream.integers(len(positive), size=len(positive)).tolist()
        ones, others = (np.concatenate([kind[run] for run in runs]) for kind in (positive, negative))
        if ones.size > 0 and others.size > 0:
            areas.append(area_under_curve(ones, others))
    if not areas:
        raise InputError("runs without values of one class", "values of both classes")
    bias = np.mean(areas) - area_under_curve(np.concatenate(positive), np.concatenate(negative))
    edges = np.quantile(areas, [0.5 - 0.5 * share, 0.5 + 0.5 * share]) - bias
    low, high = np.clip(edges, 0.0, 1.0).tolist()
    return low, high
