"""Errors are scored by rules that an estimator cannot gain by bending."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.evaluation.scores import blocks_of, regression, score_of, scored
from monochord.evaluation.results import Results

Oracle = Callable[..., Results]


def told(results: Results, name: str, values: np.ndarray) -> Results:
    return replace(results, value={**results.value, name: values})


def test_an_oracle_is_perfect(oracle: Oracle) -> None:
    for name in ("position", "force"):
        score = regression(oracle(), name)
        assert (score.answered, score.mae.value, score.within.value) == (1.0, 0.0, 1.0)
        assert score.r.value == pytest.approx(1.0, abs=1e-12)
        assert (score.bias, score.median, score.covered) == (0.0, 0.0, (1.0, 1.0))
        assert (score.windows, score.sessions, score.blocks) == (6 * 140, 6, "sessions")


def test_shuffled_estimates_are_chance(oracle: Oracle) -> None:
    results = oracle()
    rows = scored(results, "position")
    values = results.estimate("position").copy()
    values[rows] = np.random.default_rng(1).permutation(values[rows])
    score = regression(told(results, "position", values), "position")
    assert score.r.value == pytest.approx(0.0, abs=0.1)
    truth = results.label("position")[rows]
    guess = np.mean(np.abs(truth[:, None] - truth[None, :]))
    assert score.mae.value == pytest.approx(guess, rel=0.1)


def test_an_abstention_counts_as_a_miss(oracle: Oracle) -> None:
    results = oracle()
    values = results.estimate("force").copy()
    rows = np.flatnonzero(scored(results, "force"))
    values[rows[::4]] = np.nan
    score = regression(told(results, "force", values), "force")
    assert score.answered == pytest.approx(0.75)
    assert score.within.value == pytest.approx(0.75)
    assert score.mae.value == 0.0


def test_windows_that_were_not_recorded_or_touched_do_not_count(oracle: Oracle) -> None:
    results = oracle()
    values = np.where(scored(results, "position"), results.label("position"), 99.0)
    assert regression(told(results, "position", values), "position").mae.value == 0.0
    half = replace(results, usable=np.arange(len(results)) % 2 == 0)
    assert regression(half, "position").windows < 0.6 * regression(results, "position").windows


def test_honest_errors_are_covered_as_they_say(oracle: Oracle) -> None:
    covered = regression(oracle(spread=1.0), "position").covered
    assert covered == pytest.approx((0.683, 0.954), abs=0.05)


def test_intervals_draw_whole_sessions_where_there_are_enough_of_them(oracle: Oracle) -> None:
    many, few = oracle(), oracle(objects=("plastic",) * 3)
    assert len(np.unique(blocks_of(many)[0])) == 6
    blocks, what = blocks_of(few)
    assert (len(np.unique(blocks)), what) == (6, "stretches of 10 s")


def test_a_session_that_is_worse_than_the_others_widens_the_interval(oracle: Oracle) -> None:
    results = oracle(spread=1.0)
    alike = regression(results, "position").mae
    values = results.estimate("position") + np.where(results.trial == 0, 0.01, 0.0)
    unlike = regression(told(results, "position", values), "position").mae
    assert alike.low is not None
    assert alike.high is not None
    assert unlike.low is not None
    assert unlike.high is not None
    assert unlike.high - unlike.low > 10.0 * (alike.high - alike.low)


def test_without_windows_or_answers_there_are_no_scores(oracle: Oracle) -> None:
    results = oracle()
    none = regression(results, "position", np.zeros(len(results), bool))
    assert (none.windows, none.mae.value, none.answered) == (0, None, None)
    silent = regression(told(results, "position", np.full(len(results), np.nan)), "position")
    assert (silent.answered, silent.within.value, silent.mae.value) == (0.0, 0.0, None)


def test_what_has_no_limit_is_refused(oracle: Oracle) -> None:
    with pytest.raises(InputError, match="quantity 'torque': allowed is position, force"):
        regression(oracle(), "torque")


def test_one_block_gives_no_interval() -> None:
    assert score_of(lambda at: float(at.size), np.zeros(5, np.int64)).low is None
