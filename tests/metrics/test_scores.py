"""The scorer: perfect estimates, abstentions, and what it is made of."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.metrics import (
    accuracy,
    area_under_curve,
    brier_score,
    coverage,
    detection_score,
    mean_absolute_error,
    mean_error,
    pearson_r,
    regression_score,
)

RANDOM = np.random.default_rng(0)


def test_a_perfect_estimate_scores_perfectly() -> None:
    truth = RANDOM.normal(size=20)
    score = regression_score(truth, truth, np.ones(20), limit=0.0)
    assert (score.answered, score.mae, score.median, score.bias, score.within) == (1.0, 0.0, 0.0, 0.0, 1.0)
    assert score.r == pytest.approx(1.0)
    assert score.coverage == (1.0, 1.0)
    yes = np.array([True, False, True, True])
    result = detection_score(yes, yes.astype(float))
    assert (result.accuracy, result.area, result.brier, result.calibration) == (1.0, 1.0, 0.0, 0.0)
    assert (result.positive, result.baseline) == (3, 0.75)


def test_scores_are_the_plain_metrics_of_what_was_answered() -> None:
    truth, estimate = RANDOM.normal(size=50), RANDOM.normal(size=50)
    std = RANDOM.uniform(0.5, 1.5, size=50)
    estimate[:10] = np.nan
    score = regression_score(truth, estimate, std, limit=1.0)
    true, answer = truth[10:], estimate[10:]
    assert score.mae == mean_absolute_error(true, answer)
    assert score.bias == mean_error(true, answer)
    assert score.r == pearson_r(true, answer)
    assert score.coverage == tuple(coverage(true, answer, std[10:], sigmas) for sigmas in (1.0, 2.0))
    assert score.answered == 0.8
    assert score.within == np.count_nonzero(np.abs(answer - true) <= 1.0) / 50


def test_an_abstention_is_wrong_but_no_error() -> None:
    yes, chance = np.array([True, True, False, False]), np.array([0.75, np.nan, 0.25, np.nan])
    score = detection_score(yes, chance)
    assert (score.answered, score.accuracy) == (0.5, 0.5)
    assert score.area == area_under_curve(chance[[0]], chance[[2]])
    assert score.brier == brier_score(yes[[0, 2]], chance[[0, 2]])
    assert detection_score(yes, np.full(4, 0.5)).accuracy == accuracy(yes, np.ones(4, bool))


def test_nothing_to_score_is_none_and_not_nan() -> None:
    none = regression_score(np.zeros(0), np.zeros(0), limit=1.0)
    assert (none.windows, none.answered, none.mae, none.within) == (0, None, None, None)
    silent = regression_score(np.ones(3), np.full(3, np.nan), np.full(3, np.nan), limit=1.0)
    assert (silent.answered, silent.within, silent.mae, silent.coverage) == (0.0, 0.0, None, ())
    assert regression_score(np.ones(2), np.ones(2), limit=1.0).r is None
    assert detection_score(np.zeros(0, bool), np.zeros(0)).accuracy is None
    one_kind = detection_score(np.ones(2, bool), np.ones(2))
    assert (one_kind.area, one_kind.accuracy) == (None, 1.0)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: regression_score(np.zeros(2), np.zeros(3), limit=1.0),
        lambda: regression_score(np.array([np.nan]), np.zeros(1), limit=1.0),
        lambda: regression_score(np.zeros(1), np.zeros(1), limit=-1.0),
        lambda: detection_score(np.array([True, False]), np.array([0.5, 1.5])),
    ],
)
def test_what_cannot_be_scored_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
