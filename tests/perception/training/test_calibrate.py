"""Calibrated uncertainty: for any distribution of errors, and with few touches."""

import numpy as np
import pytest

from monochord.metrics import coverage
from monochord.perception.training.calibrate import (
    calibrate_probability,
    calibrate_quantity,
    spread_factor,
    temperature,
)

SESSION = np.repeat(np.arange(8), 500)


@pytest.mark.parametrize("kind", ["normal", "laplace", "standard_t"])
def test_one_sigma_covers_what_it_should_whatever_the_errors(kind: str) -> None:
    rng = np.random.default_rng(0)
    draw = {
        "normal": rng.standard_normal,
        "laplace": lambda n: rng.laplace(size=n),
        "standard_t": lambda n: rng.standard_t(2, n),
    }
    std = rng.uniform(0.5, 2.0, 8000)
    error = 3.0 * std * draw[kind](8000)
    factor = spread_factor(error[:4000], std[:4000])
    assert coverage(np.zeros(4000), error[4000:], factor * std[4000:], 1.0) == pytest.approx(0.6827, abs=0.02)


def test_few_touches_hardly_reduce_the_spread_of_training() -> None:
    error, std = 0.1 * np.ones(100), np.ones(100)
    few, many = (spread_factor(error, std, np.arange(100) * touches // 100) for touches in (3, 100))
    assert few > 0.5
    assert many == pytest.approx(0.1, rel=0.3)


def test_a_few_windows_are_covered_rather_more_than_less() -> None:
    rng = np.random.default_rng(1)
    shares = []
    for _ in range(200):
        error = rng.standard_normal(12)
        shares.append(float(np.mean(np.abs(rng.standard_normal(200)) <= spread_factor(error, np.ones(12)))))
    assert 0.68 < np.mean(shares) < 0.76


def test_without_any_error_factors_stay_finite_and_above_zero() -> None:
    assert spread_factor(np.zeros(10), np.ones(10)) > 0.0
    truth = np.arange(100) % 2 == 0
    assert 0.049 < temperature(truth, np.where(truth, 5.0, -5.0)) < 20.1


def test_the_coverage_that_is_stated_is_of_other_sessions() -> None:
    rng = np.random.default_rng(2)
    width = np.where(SESSION % 2 == 0, 1.0, 3.0)  # every other session is worse than is stated
    calibration = calibrate_quantity(
        width * rng.standard_normal(4000), np.ones(4000), SESSION, np.arange(4000)
    )
    assert (calibration.windows, calibration.sessions) == (4000, 8)
    assert calibration.measured["coverage_1_before"] == pytest.approx(0.5 * (0.683 + 0.261), abs=0.03)
    assert calibration.measured["coverage_1"] == pytest.approx(0.5 * (0.997 + 0.261), abs=0.03)


def test_a_probability_is_calibrated() -> None:
    rng = np.random.default_rng(3)
    logit = rng.normal(size=4000)
    truth = rng.random(4000) < 1.0 / (1.0 + np.exp(-logit))
    calibration = calibrate_probability(truth, 4.0 * logit, SESSION)
    assert calibration.factor == pytest.approx(4.0, rel=0.15)
    assert calibration.measured["calibration_error"] < 0.04 < calibration.measured["calibration_error_before"]


def test_one_session_is_cut_in_the_middle() -> None:
    rng = np.random.default_rng(4)
    calibration = calibrate_quantity(
        rng.standard_normal(1000), np.ones(1000), np.zeros(1000, np.int64), np.arange(1000)
    )
    assert calibration.measured["coverage_1"] == pytest.approx(0.6827, abs=0.05)


def test_few_touches_are_covered_and_their_windows_do_not_count_as_independent() -> None:
    rng = np.random.default_rng(5)
    windows, shares, wide = 20, dict[int, float](), dict[int, float]()
    for touches in (2, 4, 40):
        touch, covered, factors = np.repeat(np.arange(touches), windows), list[float](), list[float]()
        for _ in range(120):
            error = np.repeat(rng.standard_normal(touches), windows)  # one error a touch
            factor = spread_factor(error, np.ones(error.size), touch)
            covered.append(float(np.mean(np.abs(rng.standard_normal(200)) <= factor)))
            factors.append(factor)
        shares[touches], wide[touches] = float(np.mean(covered)), float(np.mean(factors))
    assert all(0.66 < share < 0.9 for share in shares.values()), shares
    assert wide[2] > wide[4] > wide[40]
