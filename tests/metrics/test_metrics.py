"""Plain metrics agree with exact fractions to 1e-12, and have the properties that their names promise."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.metrics import (
    accuracy,
    area_under_curve,
    balanced_accuracy,
    brier_score,
    calibration_error,
    confusion,
    coverage,
    finite_rows,
    mean_absolute_error,
    mean_error,
    normal_coverage,
    pearson_r,
    reliability,
    rms_error,
    within,
)

GOLDEN = json.loads(Path(__file__).with_name("golden.json").read_text(encoding="utf-8"))
ROWS = {name: np.array(values) for name, values in GOLDEN["rows"].items()}
REFERENCE, ESTIMATE, PROBABILITY = ROWS["reference"], ROWS["estimate"], ROWS["probability"]
TRUTH, SAID = ROWS["kind"] == 1, PROBABILITY >= 0.5
ERRORS = (mean_error, mean_absolute_error, rms_error, pearson_r)


def test_golden() -> None:
    result: dict[str, Any] = {metric.__name__: metric(REFERENCE, ESTIMATE) for metric in ERRORS}
    result |= {
        "within": within(REFERENCE, ESTIMATE, GOLDEN["limit"]),
        "coverage": coverage(REFERENCE, ESTIMATE, ROWS["std"], GOLDEN["sigmas"]),
        "accuracy": accuracy(TRUTH, SAID),
        "balanced_accuracy": balanced_accuracy(TRUTH, SAID),
        "area_under_curve": area_under_curve(PROBABILITY[TRUTH], PROBABILITY[~TRUTH]),
        "brier_score": brier_score(TRUTH, PROBABILITY),
        "calibration_error": calibration_error(TRUTH, PROBABILITY, GOLDEN["bins"]),
    }
    expected = dict(GOLDEN["expected"])
    assert confusion(TRUTH, SAID).tolist() == expected.pop("confusion")
    assert result == pytest.approx(expected, rel=0, abs=1e-12)


@settings(max_examples=30)
@given(st.lists(st.floats(-1e150, 1e150, allow_subnormal=False), min_size=2, max_size=30))
def test_a_perfect_estimate_has_no_error(values: list[float]) -> None:
    truth = np.array(values)
    assert mean_error(truth, truth) == mean_absolute_error(truth, truth) == rms_error(truth, truth) == 0.0
    assert within(truth, truth, 0.0) == coverage(truth, truth, np.zeros_like(truth), 0.0) == 1.0
    r = pearson_r(truth, truth)
    assert r == pytest.approx(1.0, abs=1e-12) or (np.isnan(r) and np.ptp(truth) == 0.0)


def test_perfect_reversed_and_worthless_decisions() -> None:
    assert accuracy(TRUTH, TRUTH) == balanced_accuracy(TRUTH, TRUTH) == 1.0
    assert accuracy(TRUTH, ~TRUTH) == balanced_accuracy(TRUTH, ~TRUTH) == 0.0
    assert accuracy(TRUTH.astype(float), SAID) == accuracy(TRUTH, SAID)  # pyright: ignore[reportArgumentType]
    assert brier_score(TRUTH, TRUTH.astype(float)) == calibration_error(TRUTH, TRUTH.astype(float)) == 0.0
    rare, never = np.arange(100) < 3, np.zeros(100, bool)
    assert (accuracy(rare, never), balanced_accuracy(rare, never)) == (0.97, 0.5)
    low, high = np.arange(5.0), np.arange(5.0) + 10.0
    assert [area_under_curve(*pair) for pair in ((high, low), (low, high), (low, low))] == [1.0, 0.0, 0.5]


def test_the_limit_itself_is_within() -> None:
    assert within(np.zeros(2), np.array([0.005, -0.005]), 0.005) == 1.0


def test_correlation_is_of_shape_alone_and_has_a_sign() -> None:
    r = pearson_r(REFERENCE, ESTIMATE)
    assert pearson_r(REFERENCE, 3.0 * ESTIMATE - 7.0) == pytest.approx(r, abs=1e-12)
    assert pearson_r(REFERENCE, -ESTIMATE) == pytest.approx(-r, abs=1e-12)
    assert pearson_r(1e-200 * REFERENCE, 1e200 * ESTIMATE) == pytest.approx(r, abs=1e-12)
    assert np.isnan(pearson_r(REFERENCE, np.ones_like(REFERENCE)))


def test_known_rows_are_finite_in_every_column() -> None:
    mask = finite_rows(np.array([0.0, np.nan, 1.0, 2.0]), np.array([0.0, 1.0, -np.inf, 2.0]))
    assert mask.tolist() == [True, False, False, True]


def test_any_rising_function_of_the_values_gives_the_same_area() -> None:
    stream = np.random.default_rng(1)
    a, b = stream.normal(0.5, 1.0, 30), stream.normal(0.0, 1.0, 30)
    assert area_under_curve(np.exp(3.0 * a), np.exp(3.0 * b)) == area_under_curve(a, b)


@pytest.mark.parametrize("sigmas", [0.5, 2.0])
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


@pytest.mark.parametrize("metric", ERRORS)
@pytest.mark.parametrize(
    ("reference", "estimate"),
    [
        ([0.0, 1.0], [0.0, np.nan]),
        ([0.0, np.inf], [0.0, 1.0]),
        ([0.0, 1.0], [0.0]),
        ([[0.0]], [[0.0]]),
        ([], []),
    ],
)
def test_rows_without_an_error_are_refused(
    metric: Callable[[Floats, Floats], float], reference: list[float], estimate: list[float]
) -> None:
    with pytest.raises(InputError, match=r"reference|estimate"):
        metric(np.array(reference), np.array(estimate))


ONE, YES, SOME, NONE = np.zeros(2), np.ones(3, bool), np.ones(3), np.zeros(0)
HALF: Any = np.array([1.0, 0.5])
"""Decisions that are neither yes nor no."""


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: within(ONE, ONE, -1.0),
        lambda: finite_rows(ONE, SOME),
        finite_rows,
        lambda: coverage(ONE, ONE, np.array([1.0, -1.0])),
        lambda: coverage(ONE, ONE, np.array([1.0, np.nan])),
        lambda: normal_coverage(-1.0),
        lambda: brier_score(ONE == 0.0, np.array([0.0, 1.5])),
        lambda: brier_score(ONE == 0.0, SOME),
        lambda: reliability(ONE == 0.0, ONE, 0),
        lambda: accuracy(ONE == 0.0, HALF),
        lambda: confusion(HALF * np.nan, HALF == 1.0),
        lambda: accuracy(YES, YES[:2]),
        lambda: balanced_accuracy(YES, YES),
        lambda: balanced_accuracy(~YES, YES),
        lambda: area_under_curve(SOME, NONE),
        lambda: area_under_curve(SOME, np.array([np.nan])),
    ],
)
def test_what_cannot_be_scored_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
