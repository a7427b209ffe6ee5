"""Errors of a quantity."""

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.ranges import checked
from monochord.core.types import Floats
from monochord.metrics._checked import numbers


def finite_rows(*columns: Floats) -> NDArray[np.bool_]:
    """Return a mask (n,) of the rows that are finite in every column (n,), and can therefore be scored.

    Report their number beside every score.

    Parameters
    ----------
    columns
        References, estimates, standard errors ..., (n,) each, in any unit.

    Raises
    ------
    InputError
        If there is no column, or the columns differ in length.

    Examples
    --------
    >>> finite_rows(np.array([1.0, np.nan, 3.0]), np.array([1.0, 2.0, np.inf])).tolist()
    [True, False, False]
    """
    if len({np.shape(column) for column in columns}) != 1:
        raise InputError(f"columns of shape {[np.shape(column) for column in columns]}", "one length")
    return np.logical_and.reduce([np.isfinite(column) for column in columns])


def mean_error(reference: Floats, estimate: Floats) -> float:
    """Return the mean of estimate - reference: the bias.

    Parameters
    ----------
    reference, estimate
        Truth and estimate, (n,) each, in the same unit as the result.

    Raises
    ------
    InputError
        If shapes differ, or an array is empty or not finite; as in every metric here.

    Examples
    --------
    >>> mean_error(np.array([1.0, 2.0]), np.array([1.5, 2.0]))
    0.25
    """
    reference, estimate = numbers(reference=reference, estimate=estimate)
    return float(np.mean(estimate - reference))


@checked
def mean_absolute_error(reference: Floats, estimate: Floats) -> float:
    """Return the mean absolute difference of estimate and reference: the MAE.

    Parameters
    ----------
    reference, estimate
        Truth and estimate, (n,) each, in the same unit as the result.

    Examples
    --------
    >>> mean_absolute_error(np.array([1.0, 2.0]), np.array([1.5, 1.5]))
    0.5
    """
    reference, estimate = numbers(reference=reference, estimate=estimate)
    return float(np.mean(np.abs(estimate - reference)))


def rms_error(reference: Floats, estimate: Floats) -> float:
    """Return the root mean square of estimate - reference; a single large error can dominate it.

    Parameters
    ----------
    reference, estimate
        Truth and estimate, (n,) each, in the same unit as the result.

    Examples
    --------
    >>> rms_error(np.array([0.0, 0.0]), np.array([1.0, -7.0]))
    5.0
    """
    reference, estimate = numbers(reference=reference, estimate=estimate)
    return float(np.sqrt(np.mean((estimate - reference) ** 2)))


def within(reference: Floats, estimate: Floats, limit: float) -> float:
    """Return the share of estimates with an error of `limit` or less, 0 to 1.

    Parameters
    ----------
    reference, estimate
        Truth and estimate, (n,) each, in one unit.
    limit
        Error limit in the same unit, 0 or more.

    Examples
    --------
    >>> within(np.array([0.0, 0.0]), np.array([0.25, 0.75]), 0.5)
    0.5
    """
    reference, estimate = numbers(reference=reference, estimate=estimate)
    if not limit >= 0.0:
        raise InputError(f"limit {limit:g}", "0 or more")
    return float(np.mean(np.abs(estimate - reference) <= limit))


def pearson_r(reference: Floats, estimate: Floats) -> float:
    """Return Pearson's correlation, -1 to 1; NaN if either array is constant.

    r = sum(a b) / sqrt(sum(a^2) sum(b^2)), with a and b minus their means. A wrong offset or scale does not
    affect it: read it beside the mean absolute error.

    Parameters
    ----------
    reference, estimate
        Truth and estimate, (n,) each, in any unit.

    References
    ----------
    Pearson (1896), Regression, heredity and panmixia, Philosophical Transactions A 187, 253.

    Examples
    --------
    >>> round(pearson_r(np.array([0.0, 1.0, 2.0]), np.array([5.0, 7.0, 9.0])), 12)
    1.0
    """
    a, b = numbers(reference=reference, estimate=estimate)
    if a.min() == a.max() or b.min() == b.max():
        return float("nan")
    # Scaled first, so that the squares of very large or very small values stay numbers.
    a, b = ((values - values.mean()) / np.ptp(values) for values in (a, b))
    return float(np.clip(np.sum(a * b) / np.sqrt(np.sum(a * a) * np.sum(b * b)), -1.0, 1.0))
