"""Doubt that comes true: on whatever errors, and measured where it was not fitted."""

import numpy as np
import pytest

from monochord.metrics import coverage
from monochord.perception.training.calibrate import (
    calibrated_amount,
    calibrated_chance,
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


def test_a_few_windows_are_covered_rather_more_than_less() -> None:
    rng = np.random.default_rng(1)
    shares = []
    for _ in range(400):
        error = rng.standard_normal(12)
        shares.append(float(np.mean(np.abs(rng.standard_normal(200)) <= spread_factor(error, np.ones(12)))))
    assert 0.68 < np.mean(shares) < 0.76


def test_no_error_at_all_gives_no_factor_of_zero() -> None:
    assert spread_factor(np.zeros(10), np.ones(10)) > 0.0


def test_chances_told_without_error_are_left_finite() -> None:
    truth = np.arange(100) % 2 == 0
    assert 0.5 <= temperature(truth, np.where(truth, 5.0, -5.0)) <= 20.0


def test_the_coverage_that_is_stated_is_of_other_sessions() -> None:
    rng = np.random.default_rng(2)
    width = np.where(SESSION % 2 == 0, 1.0, 3.0)  # every other session is worse than is stated
    found = calibrated_amount(width * rng.standard_normal(4000), np.ones(4000), SESSION)
    assert (found.windows, found.sessions) == (4000, 8)
    assert found.measured["coverage_1_before"] == pytest.approx(0.5 * (0.683 + 0.261), abs=0.03)
    assert found.measured["coverage_1"] == pytest.approx(0.5 * (0.997 + 0.261), abs=0.03)


def test_a_chance_is_calibrated() -> None:
    rng = np.random.default_rng(3)
    logit = rng.normal(size=4000)
    truth = rng.random(4000) < 1.0 / (1.0 + np.exp(-logit))
    found = calibrated_chance(truth, 4.0 * logit, SESSION)
    assert found.factor == pytest.approx(4.0, rel=0.15)
    assert found.measured["calibration_error"] < 0.04 < found.measured["calibration_error_before"]


def test_one_session_is_cut_in_the_middle() -> None:
    rng = np.random.default_rng(4)
    found = calibrated_amount(rng.standard_normal(1000), np.ones(1000), np.zeros(1000, np.int64))
    assert found.measured["coverage_1"] == pytest.approx(0.6827, abs=0.05)
