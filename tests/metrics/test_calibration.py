"""Coverage and calibration agree with exact fractions, and honest uncertainty is confirmed."""

import json
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.metrics import (
    brier_score,
    calibration_error,
    coverage,
    normal_coverage,
    reliability,
)

GOLDEN = json.loads(Path(__file__).with_name("golden.json").read_text(encoding="utf-8"))
ROWS = {name: np.array(values) for name, values in GOLDEN["rows"].items()}
EXPECTED = GOLDEN["expected"]
TRUTH = ROWS["kind"] == 1


def test_golden() -> None:
    result = {
        "coverage": coverage(ROWS["reference"], ROWS["estimate"], ROWS["std"], GOLDEN["sigmas"]),
        "brier_score": brier_score(TRUTH, ROWS["probability"]),
        "calibration_error": calibration_error(TRUTH, ROWS["probability"], GOLDEN["bins"]),
    }
    assert result == pytest.approx({name: EXPECTED[name] for name in result}, rel=0, abs=1e-12)


def test_a_perfect_estimate_is_covered_even_by_nothing() -> None:
    truth = ROWS["reference"]
    assert coverage(truth, truth, np.zeros_like(truth), 0.0) == 1.0
    assert brier_score(TRUTH, TRUTH.astype(float)) == calibration_error(TRUTH, TRUTH.astype(float)) == 0.0


@pytest.mark.parametrize("sigmas", [0.5, 1.0, 2.0])
def test_honest_normal_errors_are_covered_as_the_normal_law_says(sigmas: float) -> None:
    stream = np.random.default_rng(0)
    std = stream.uniform(0.1, 3.0, 20000)
    truth = stream.normal(size=std.size)
    estimate = truth + std * stream.normal(size=std.size)
    assert coverage(truth, estimate, std, sigmas) == pytest.approx(normal_coverage(sigmas), abs=0.012)
    assert coverage(truth, estimate, 0.5 * std, sigmas) < normal_coverage(sigmas) - 0.1


def test_normal_coverage_is_the_known_share() -> None:
    assert normal_coverage(0.0) == 0.0
    assert normal_coverage(1.959963984540054) == pytest.approx(0.95, abs=1e-12)


def test_reliability_counts_each_row_once_and_edges_go_up() -> None:
    probability = np.array([0.0, 0.5, 0.5, 1.0])
    stated, share, count = reliability(np.array([False, True, False, True]), probability, bins=4)
    assert count.tolist() == [1, 0, 2, 1]
    np.testing.assert_array_equal(stated, [0.0, np.nan, 0.5, 1.0])
    np.testing.assert_array_equal(share, [0.0, np.nan, 0.5, 1.0])


def test_honest_probabilities_are_calibrated_and_boasting_is_seen() -> None:
    stream = np.random.default_rng(2)
    probability = stream.uniform(size=20000)
    truth = stream.uniform(size=probability.size) < probability
    assert calibration_error(truth, probability) < 0.02
    assert calibration_error(truth, np.round(probability)) > 0.2


def test_what_cannot_be_scored_is_refused() -> None:
    one = np.zeros(2)
    with pytest.raises(InputError, match="standard error -1"):
        coverage(one, one, np.array([1.0, -1.0]))
    with pytest.raises(InputError, match="1 of 2 in std not finite"):
        coverage(one, one, np.array([1.0, np.nan]))
    with pytest.raises(InputError, match="0 or more"):
        normal_coverage(-1.0)
    with pytest.raises(InputError, match=r"probabilities 0 to 1\.5: allowed is 0 to 1"):
        brier_score(one == 0.0, np.array([0.0, 1.5]))
    with pytest.raises(InputError, match="the same length"):
        brier_score(one == 0.0, np.zeros(3))
    with pytest.raises(InputError, match="0 bins"):
        reliability(one == 0.0, one, 0)
