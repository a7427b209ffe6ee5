"""Calibration: how far a head's stated uncertainty is from its errors, and the factor that corrects it."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.metrics import brier_score, calibration_error, coverage, normal_coverage
from monochord.perception.model.definition import Calibration

FACTORS = np.exp(np.linspace(math.log(0.5), math.log(20.0), 401))
"""Temperatures that are tried; bounded, since probabilities without an error have no best one."""
SIGMAS = (1.0, 1.645, 1.96)
MIN_FACTOR = 1e-6
PRIOR_TOUCHES = 10.0
"""Touches that the spread of training, which is of unseen touches, is worth against a factor below 1."""
Indices = NDArray[np.int64]


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


def spread_factor(error: Floats, std: Floats, touch: Indices | None = None) -> float:
    """Return the factor that makes stated standard errors (n,) cover the errors (n,) as one sigma should.

    It is the quantile of ``|error| / std`` at 68.3 % (m + 1) / m, the finite-sample one of split conformal
    prediction, times Student's t at one sigma with m - 1 degrees of freedom: m is the number of touches,
    since the windows of one touch have much the same error. So few touches give a large factor; and one
    below 1, which would state less than the residuals of training, counts by its m in m + `PRIOR_TOUCHES`.

    Parameters
    ----------
    error, std
        Error and stated standard error (n,) of windows that the model was not trained on, in one unit.
    touch
        The touch (n,) of each window; without it each window is independent.

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
    from scipy.special import ndtr, stdtrit  # noqa: PLC0415

    ratio = np.sort(np.abs(error) / std)
    count = ratio.size if touch is None else len(np.unique(touch))
    rank = math.ceil(ratio.size * (count + 1) / count * normal_coverage(1.0) - 1e-9)
    inflation = float(stdtrit(max(count - 1, 1), ndtr(1.0)))
    factor = max(inflation * float(ratio[min(rank, ratio.size) - 1]), MIN_FACTOR)
    return factor if factor >= 1.0 else factor ** (count / (count + PRIOR_TOUCHES))


def calibrate_probability(reference: NDArray[np.bool_], logit: Floats, session: Indices) -> Calibration:
    """Return the calibration of a probability, with its calibration error on sessions not used for it."""

    def probabilities(factor: Floats) -> Floats:
        return 1.0 / (1.0 + np.exp(-np.clip(logit / factor, -700.0, 700.0)))

    factor = _from_other_sessions(session, lambda rows: temperature(reference[rows], logit[rows]))
    after, before = probabilities(factor), probabilities(np.ones(len(logit)))
    return Calibration(
        factor=temperature(reference, logit),
        windows=len(logit),
        sessions=len(np.unique(session)),
        measured={
            "calibration_error": calibration_error(reference, after),
            "calibration_error_before": calibration_error(reference, before),
            "brier_score": brier_score(reference, after),
        },
    )


def calibrate_quantity(error: Floats, std: Floats, session: Indices, touch: Indices) -> Calibration:
    """Return the calibration of a quantity, with the coverage on sessions not used for it."""
    factor = _from_other_sessions(session, lambda rows: spread_factor(error[rows], std[rows], touch[rows]))
    zeros = np.zeros(len(error))
    measured = {f"coverage_{sigmas:g}": coverage(zeros, error, factor * std, sigmas) for sigmas in SIGMAS}
    measured["coverage_1_before"] = coverage(zeros, error, std, 1.0)
    return Calibration(
        factor=spread_factor(error, std, touch),
        windows=len(error),
        touches=len(np.unique(touch)),
        sessions=len(np.unique(session)),
        measured=measured,
    )


def _from_other_sessions(session: Indices, factor_of: Callable[[NDArray[np.bool_]], float]) -> Floats:
    """Return for each window (n,) the factor that the other half of the sessions gives.

    A single session is cut in the middle.
    """
    names = np.unique(session)
    half = np.arange(len(session)) < len(session) // 2
    first = np.isin(session, names[::2]) if len(names) > 1 else half
    if first.all() or not first.any():
        return np.full(len(session), factor_of(np.ones(len(session), dtype=bool)))
    return np.where(first, factor_of(~first), factor_of(first))
