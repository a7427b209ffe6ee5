"""Errors of a quantity agree with exact fractions to 1e-12; a perfect estimate scores perfectly."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.metrics import known, mean_absolute_error, mean_error, pearson_r, rms_error, within

Metric = Callable[[Floats, Floats], float]
GOLDEN = json.loads(Path(__file__).with_name("golden.json").read_text(encoding="utf-8"))
ROWS = {name: np.array(values) for name, values in GOLDEN["rows"].items()}
EXPECTED = GOLDEN["expected"]


@pytest.mark.parametrize("metric", [mean_error, mean_absolute_error, rms_error, pearson_r])
def test_golden(metric: Metric) -> None:
    result = metric(ROWS["reference"], ROWS["estimate"])
    assert result == pytest.approx(EXPECTED[metric.__name__], rel=0, abs=1e-12)


def test_golden_within() -> None:
    result = within(ROWS["reference"], ROWS["estimate"], GOLDEN["limit"])
    assert result == pytest.approx(EXPECTED["within"], rel=0, abs=1e-12)


@given(st.lists(st.floats(-1e150, 1e150, allow_subnormal=False), min_size=2, max_size=30))
def test_perfect(values: list[float]) -> None:
    truth = np.array(values)
    assert mean_error(truth, truth) == mean_absolute_error(truth, truth) == rms_error(truth, truth) == 0.0
    assert within(truth, truth, 0.0) == 1.0
    r = pearson_r(truth, truth)
    assert r == pytest.approx(1.0, abs=1e-12) or (np.isnan(r) and np.ptp(truth) == 0.0)


def test_the_limit_itself_is_within() -> None:
    assert within(np.zeros(2), np.array([0.005, -0.005]), 0.005) == 1.0
    with pytest.raises(InputError, match="limit -1: allowed is 0 or more"):
        within(np.zeros(2), np.zeros(2), -1.0)


def test_correlation_is_of_shape_alone_and_has_a_sign() -> None:
    truth, answer = ROWS["reference"], ROWS["estimate"]
    r = pearson_r(truth, answer)
    assert pearson_r(truth, 3.0 * answer - 7.0) == pytest.approx(r, abs=1e-12)
    assert pearson_r(truth, -answer) == pytest.approx(-r, abs=1e-12)
    assert pearson_r(1e-200 * truth, 1e200 * answer) == pytest.approx(r, abs=1e-12)
    assert np.isnan(pearson_r(truth, np.ones_like(truth)))


def test_known_rows_are_finite_in_every_column() -> None:
    mask = known(np.array([0.0, np.nan, 1.0, 2.0]), np.array([0.0, 1.0, -np.inf, 2.0]))
    assert mask.tolist() == [True, False, False, True]
    with pytest.raises(InputError, match="one length"):
        known(np.zeros(2), np.zeros(3))
    with pytest.raises(InputError, match="one length"):
        known()


@pytest.mark.parametrize("metric", [mean_error, mean_absolute_error, rms_error, pearson_r])
@pytest.mark.parametrize(
    ("reference", "estimate", "message"),
    [
        (
            [0.0, 1.0],
            [0.0, np.nan],
            "1 of 2 in estimate not finite: allowed is numbers; select rows",
        ),
        ([0.0, np.inf], [0.0, 1.0], "1 of 2 in reference not finite"),
        ([0.0, 1.0], [0.0], r"reference of shape \(2,\), estimate of shape \(1,\)"),
        ([[0.0]], [[0.0]], "allowed is one dimension"),
        ([], [], "no reference: allowed is one value or more"),
    ],
)
def test_what_cannot_be_scored_is_refused(
    metric: Metric, reference: list[float], estimate: list[float], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        metric(np.array(reference), np.array(estimate))
