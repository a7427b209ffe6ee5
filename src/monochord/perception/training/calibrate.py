"""Whether what heads say of their own doubt comes true, and by what factor it does."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.metrics import brier_score, calibration_error, coverage, normal_coverage
from monochord.perception.model.definition import Calibration

FACTORS = np.exp(np.linspace(math.log(0.5), math.log(20.0), 401))
"""Temperatures that are tried; bounded, since chances that are told without error have none that is best."""
SIGMAS = (1.0, 1.645, 1.96)


def temperature(reference: NDArray[np.bool_], logit: Floats) -> float:
    """Return the factor by which logits (n,) are divided so that their log loss is least.

    References
    ----------
    Guo, Pleiss, Sun and Weinberger, On calibration of modern neural networks (2017).

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> logit = rng.normal(size=20000)
    >>> truth = rng.random(20000) < 1.0 / (1.0 + np.exp(-logit))
    >>> round(temperature(truth, 3.0 * logit), 1)
    3.0
    """
    sign = np.where(reference, -1.0, 1.0)
    losses = [float(np.logaddexp(0.0, sign * logit / factor).mean()) for factor in FACTORS]
    return float(FACTORS[int(np.argmin(losses))])


def spread_factor(error: Floats, std: Floats) -> float:
    """Return the factor that makes stated standard errors (n,) cover the errors (n,) as one sigma should.

    It is the quantile of ``|error| / std`` at 68.3 %, the finite-sample one of split conformal prediction: of
    new windows like these, at least that share will be covered on average, whatever the distribution.

    References
    ----------
    Lei, G'Sell, Rinaldo, Tibshirani and Wasserman, Distribution-free predictive inference for regression
    (2018), section 2.2 with the scaled score of section 5.2.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> round(spread_factor(rng.normal(size=20000), np.full(20000, 0.5)), 1)
    2.0
    """
    ratio = np.sort(np.abs(error) / std)
    rank = math.ceil((ratio.size + 1) * normal_coverage(1.0))
    return float(max(ratio[min(rank, ratio.size) - 1], 1e-6))


def calibrated_chance(reference: NDArray[np.bool_], logit: Floats, session: NDArray[np.int64]) -> Calibration:
    """Return the calibration of a chance, with what it is worth on sessions that it does not come from."""

    def told(factor: Floats) -> Floats:
        return 1.0 / (1.0 + np.exp(-np.clip(logit / factor, -700.0, 700.0)))

    others = _from_others(session, lambda rows: temperature(reference[rows], logit[rows]))
    chance, before = told(others), told(np.ones(len(logit)))
    return Calibration(
        factor=temperature(reference, logit),
        windows=len(logit),
        sessions=len(np.unique(session)),
        measured={
            "calibration_error": calibration_error(reference, chance),
            "calibration_error_before": calibration_error(reference, before),
            "brier_score": brier_score(reference, chance),
        },
    )


def calibrated_amount(error: Floats, std: Floats, session: NDArray[np.int64]) -> Calibration:
    """Return the calibration of an amount, with the coverage on sessions that it does not come from."""
    others = _from_others(session, lambda rows: spread_factor(error[rows], std[rows]))
    nothing = np.zeros(len(error))
    measured = {f"coverage_{sigmas:g}": coverage(nothing, error, others * std, sigmas) for sigmas in SIGMAS}
    measured["coverage_1_before"] = coverage(nothing, error, std, 1.0)
    return Calibration(
        factor=spread_factor(error, std),
        windows=len(error),
        sessions=len(np.unique(session)),
        measured=measured,
    )


def _from_others(session: NDArray[np.int64], factor_of: Callable[[NDArray[np.bool_]], float]) -> Floats:
    """Return for each window (n,) the factor that the other half of the sessions gives.

    A single session is cut in the middle.
    """
    names = np.unique(session)
    half = np.arange(len(session)) < len(session) // 2
    first = np.isin(session, names[::2]) if len(names) > 1 else half
    if first.all() or not first.any():
        return np.full(len(session), factor_of(np.ones(len(session), dtype=bool)))
    return np.where(first, factor_of(~first), factor_of(first))
