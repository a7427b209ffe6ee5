"""Scaling of a head's stated uncertainty to its errors."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.metrics import brier_score, calibration_error, coverage, normal_coverage
from monochord.perception.model.definition import Calibration

FACTORS = np.exp(np.linspace(math.log(0.05), math.log(20.0), 601))
"""Candidate temperatures. They are bounded, because probabilities without an error have no best
temperature."""
SIGMAS = (1.0, 1.645, 1.96)
MIN_FACTOR = 1e-6
PRIOR_TOUCHES = 10.0
"""Number of touches that the spread learned in training counts for, against a factor below 1."""
Indices = NDArray[np.int64]


def temperature(reference: NDArray[np.bool_], logit: Floats) -> float:
    """Return the divisor of logits (n,) that minimises the log loss for the labels `reference` (n,).

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
    """Return the factor with which stated standard errors (n,) cover 68.3 % of errors (n,).

    The factor is the quantile of ``|error| / std`` at 68.3 % (m + 1) / m (split conformal prediction for
    finite samples), times Student's t at one sigma with m - 1 degrees of freedom. m is the number of touches,
    because the windows of one touch have nearly the same error; without `touch` (n,) every window is
    independent. So few touches give a large factor. A factor below 1 would state less than the residuals of
    the training; therefore it is raised to the power m / (m + `PRIOR_TOUCHES`).

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


def calibrate_probability(
    reference: NDArray[np.bool_], logit: Floats, session: Indices, *, windows: int | None = None
) -> Calibration:
    """Return the calibration of a probability, with the calibration error on held-out sessions.

    `windows` is the number of windows where some of the labels and logits (n,) are of noisy copies.
    """

    def probabilities(factor: Floats) -> Floats:
        return 1.0 / (1.0 + np.exp(-np.clip(logit / factor, -700.0, 700.0)))

    factor = _from_other_sessions(session, lambda rows: temperature(reference[rows], logit[rows]))
    after, before = probabilities(factor), probabilities(np.ones(len(logit)))
    return Calibration(
        factor=temperature(reference, logit),
        windows=len(logit) if windows is None else windows,
        sessions=len(np.unique(session)),
        measured={
            "calibration_error": calibration_error(reference, after),
            "calibration_error_before": calibration_error(reference, before),
            "brier_score": brier_score(reference, after),
        },
    )


def calibrate_quantity(error: Floats, std: Floats, session: Indices, touch: Indices) -> Calibration:
    """Return the calibration of a quantity, with the coverage on held-out sessions."""
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
