"""All scores of one output, from truth and estimates, with abstentions counted.

Live runs, training and evaluation all use these functions. An abstention is NaN: it counts as a miss in a
share of all windows, and is left out of an error, which `answered` accompanies.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.ranges import checked
from monochord.core.types import Floats
from monochord.metrics._checked import decisions, numbers
from monochord.metrics.calibration import brier_score, calibration_error, coverage
from monochord.metrics.ranking import area_under_curve
from monochord.metrics.regression import finite_rows, mean_absolute_error, mean_error, pearson_r

LIMITS: Mapping[str, float] = MappingProxyType({"position": 5e-3, "force": 0.2})
"""Largest error, in m and N, of an estimate that counts as correct: the limits of the paper's tables."""
DECISION = 0.5
"""Probability from which the answer is yes."""
SIGMAS = (1.0, 2.0)
"""Standard errors within which the share of truths is reported."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RegressionScore:
    """Scores of a quantity, in its SI unit; None where undefined.

    Of the `windows`, the share `answered` has an estimate. Over these are the mean absolute error `mae`, the
    `median` absolute error, the mean error `bias`, Pearson's `r` (None where truth or estimate is constant)
    and `coverage`: the shares of truths within `SIGMAS` stated standard errors, empty where none is stated.
    `within` is the share of all windows with an error of at most `limit`.
    """

    windows: int
    limit: float
    answered: float | None = None
    mae: float | None = None
    median: float | None = None
    bias: float | None = None
    r: float | None = None
    within: float | None = None
    coverage: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionScore:
    """Scores of a binary label; None where undefined.

    Of the `windows`, `positive` are positive, and the share `answered` has a probability. `accuracy` is over
    all windows, `baseline` that of always giving the more frequent answer; the `area` under the curve, the
    `brier` score and the `calibration` error are over the answered ones.
    """

    windows: int
    positive: int
    baseline: float | None = None
    answered: float | None = None
    accuracy: float | None = None
    area: float | None = None
    brier: float | None = None
    calibration: float | None = None


@checked
def regression_score(
    reference: Floats, estimate: Floats, std: Floats | None = None, *, limit: float
) -> RegressionScore:
    """Return the scores of a quantity.

    Parameters
    ----------
    reference, estimate
        Truth and estimate, (n,) each, in one unit; the estimate is NaN for an abstention.
    std
        Stated standard error (n,), 0 or more, in the same unit; NaN for an abstention.
    limit
        Largest error of an estimate that counts as correct, in the same unit, 0 or more.

    Raises
    ------
    InputError
        If the shapes differ, a truth is not finite, or a limit or standard error is below 0.

    Examples
    --------
    >>> score = regression_score(np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.5, np.nan]), limit=0.2)
    >>> score.mae, score.answered == 2 / 3, score.within == 1 / 3
    (0.25, True, True)
    """
    reference, estimate = _arrays(reference, estimate)
    if std is not None and std.shape != reference.shape:
        raise InputError(f"std of shape {std.shape}", f"{reference.shape}, as the reference")
    blank = RegressionScore(windows=reference.size, limit=limit)
    if not reference.size:
        return blank
    answered = finite_rows(estimate)
    some = replace(blank, answered=float(answered.mean()), within=hit_rate(reference, estimate, limit))
    if not answered.any():
        return some
    true, said = reference[answered], estimate[answered]
    stated = answered & finite_rows(std) if std is not None else np.zeros(reference.size, bool)
    r = pearson_r(true, said)
    return replace(
        some,
        mae=mean_absolute_error(true, said),
        median=float(np.median(np.abs(said - true))),
        bias=mean_error(true, said),
        r=None if np.isnan(r) else r,
        coverage=tuple(coverage(reference[stated], estimate[stated], std[stated], k) for k in SIGMAS)
        if std is not None and stated.any()
        else (),
    )


@checked
def detection_score(reference: NDArray[np.bool_], probability: Floats) -> DetectionScore:
    """Return the scores of a binary label.

    Parameters
    ----------
    reference
        Truth (n,): false and true, or 0 and 1.
    probability
        Probability of yes, (n,), 0 to 1; NaN for an abstention.

    Raises
    ------
    InputError
        If the shapes differ, a truth is neither 0 nor 1, or a probability is not between 0 and 1.

    Examples
    --------
    >>> score = detection_score(np.array([True, False, False]), np.array([0.9, 0.2, np.nan]))
    >>> score.accuracy == 2 / 3, score.area, score.positive
    (True, 1.0, 1)
    """
    truth, probability = _arrays(np.asarray(reference, np.float64), probability)
    if not truth.size:
        return DetectionScore(windows=0, positive=0)
    (yes,), answered = decisions(reference=reference), finite_rows(probability)
    share = float(yes.mean())
    true, said = yes[answered], probability[answered]
    both = true.any() and not true.all()
    return DetectionScore(
        windows=yes.size,
        positive=int(yes.sum()),
        baseline=max(share, 1.0 - share),
        answered=float(answered.mean()),
        accuracy=decision_accuracy(yes, probability),
        area=area_under_curve(said[true], said[~true]) if both else None,
        brier=brier_score(true, said) if said.size else None,
        calibration=calibration_error(true, said) if said.size else None,
    )


def hit_rate(reference: Floats, estimate: Floats, limit: float) -> float:
    """Return the share of all windows with an error of at most `limit`; an abstention, NaN, is a miss.

    >>> hit_rate(np.zeros(4), np.array([0.1, 0.3, np.nan, -0.2]), 0.2)
    0.5
    """
    if not limit >= 0.0:
        raise InputError(f"limit {limit:g}", "0 or more")
    return float(np.mean(np.abs(estimate - reference) <= limit))


def decision_accuracy(reference: NDArray[np.bool_], probability: Floats) -> float:
    """Return the share of all windows on the correct side of `DECISION`; an abstention, NaN, is wrong.

    >>> decision_accuracy(np.array([True, False, True]), np.array([0.5, 0.4, np.nan])) == 2 / 3
    True
    """
    return float(np.mean(((probability >= DECISION) == reference) & finite_rows(probability)))


def _arrays(reference: Floats, estimate: Floats) -> tuple[Floats, Floats]:
    """Return truth and estimate as float64 of equal length; the truth must be finite."""
    reference, estimate = (np.asarray(values, np.float64) for values in (reference, estimate))
    if reference.ndim != 1 or reference.shape != estimate.shape:
        given = f"reference of shape {reference.shape}, estimate of shape {estimate.shape}"
        raise InputError(given, "one dimension, the same length")
    if reference.size:
        numbers(reference=reference)
    return reference, estimate
