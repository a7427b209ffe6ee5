"""Calibration of standard errors and of probabilities."""

from math import erf, sqrt

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.metrics._checked import decisions, numbers, probabilities


def coverage(reference: Floats, estimate: Floats, std: Floats, sigmas: float = 1.0) -> float:
    """Return the share of truths within `sigmas` stated standard errors, 0 to 1.

    Correct normal standard errors give `normal_coverage(sigmas)`; a larger share means that the standard
    errors are too large.

    Parameters
    ----------
    reference, estimate, std
        Truth, estimate and standard error, (n,) each, in one unit; `std` is 0 or more.
    sigmas
        Number of standard errors, 0 or more.

    Raises
    ------
    InputError
        If shapes differ, an array is empty or not finite, or a standard error is below 0.

    Examples
    --------
    >>> coverage(np.zeros(4), np.array([0.5, 1.5, 2.5, -0.5]), np.ones(4), 2.0)
    0.75
    """
    reference, estimate, std = numbers(reference=reference, estimate=estimate, std=std)
    if std.min() < 0.0 or not sigmas >= 0.0:
        raise InputError(f"standard error {std.min():g}, {sigmas:g} of them", "0 or more")
    return float(np.mean(np.abs(estimate - reference) <= sigmas * std))


def normal_coverage(sigmas: float) -> float:
    """Return the share of normally distributed errors within `sigmas` standard deviations.

    erf(k / sqrt(2)); 0.683, 0.954 and 0.997 for k = 1, 2 and 3.

    Examples
    --------
    >>> round(normal_coverage(1.0), 4)
    0.6827
    """
    if not sigmas >= 0.0:
        raise InputError(f"{sigmas:g} standard deviations", "0 or more")
    return erf(sigmas / sqrt(2.0))


def brier_score(reference: NDArray[np.bool_], probability: Floats) -> float:
    """Return the mean of (probability - truth)^2: 0 is perfect, always one half gives 0.25.

    Parameters
    ----------
    reference
        Truth (n,): false and true, or 0 and 1.
    probability
        Stated probability of true, (n,), 0 to 1.

    References
    ----------
    Brier (1950), Verification of forecasts expressed in terms of probability, Monthly Weather Review 78, 1.

    Examples
    --------
    >>> brier_score(np.array([True, False]), np.array([0.5, 0.5]))
    0.25
    """
    (truth,), (probability,) = decisions(reference=reference), numbers(probability=probability)
    numbers(reference=truth.astype(np.float64), probability=probability)
    probabilities(probability)
    return float(np.mean((probability - truth) ** 2))


def reliability(
    reference: NDArray[np.bool_], probability: Floats, bins: int = 10
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Return mean stated probability, true share and count, (bins,) each, in bins of equal width.

    A bin includes its lower edge and excludes its upper edge, except the last one, which includes 1. An empty
    bin has NaN for probability and share.

    Parameters
    ----------
    reference
        Truth (n,): false and true, or 0 and 1.
    probability
        Stated probability of true, (n,), 0 to 1.
    bins
        Number of bins, 1 or more.

    References
    ----------
    Murphy and Winkler (1977), Reliability of subjective probability forecasts of precipitation and
    temperature, Applied Statistics 26, 41.

    Examples
    --------
    >>> stated, share, count = reliability(np.array([False, True, True]), np.array([0.1, 0.7, 0.9]), bins=2)
    >>> np.round(stated, 12).tolist(), share.tolist(), count.tolist()
    ([0.1, 0.8], [0.0, 1.0], [1, 2])
    """
    (truth,), (probability,) = decisions(reference=reference), numbers(probability=probability)
    numbers(reference=truth.astype(np.float64), probability=probability)
    probabilities(probability)
    if bins < 1:
        raise InputError(f"{bins} bins", "1 or more")
    edges = np.linspace(0.0, 1.0, bins + 1)[1:-1]
    where = np.searchsorted(edges, probability, side="right")
    count = np.bincount(where, minlength=bins)
    shared = np.where(count == 0, np.nan, np.maximum(count, 1))
    stated = np.bincount(where, probability, minlength=bins) / shared
    share = np.bincount(where, truth, minlength=bins) / shared
    return stated, share, count.astype(np.int64)


def calibration_error(reference: NDArray[np.bool_], probability: Floats, bins: int = 10) -> float:
    """Return the count-weighted difference between stated probabilities and true shares, 0 to 1.

    This is the expected calibration error: the sum over the bins of `reliability` of count / n abs(stated -
    share).

    Parameters
    ----------
    reference
        Truth (n,): false and true, or 0 and 1.
    probability
        Stated probability of true, (n,), 0 to 1.
    bins
        Number of bins, 1 or more.

    References
    ----------
    Naeini, Cooper and Hauskrecht (2015), Obtaining well calibrated probabilities using Bayesian binning,
    Proc. 29th AAAI Conf. Artificial Intelligence, 2901.

    Examples
    --------
    >>> round(calibration_error(np.array([True, True, True, False]), np.full(4, 0.9)), 12)
    0.15
    """
    stated, share, count = reliability(reference, probability, bins)
    some = count > 0
    return float(np.sum(count[some] * np.abs(stated[some] - share[some])) / count.sum())
