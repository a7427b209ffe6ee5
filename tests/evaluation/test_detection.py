"""Contact and sliding are scored by rules that are known beforehand."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.evaluation.scores import by_speed, detection, speed
from monochord.evaluation.results import Results

Oracle = Callable[..., Results]


def told(results: Results, name: str, values: np.ndarray) -> Results:
    return replace(results, value={**results.value, name: values})


def test_an_oracle_is_perfect(oracle: Oracle) -> None:
    score = detection(oracle(), "contact")
    assert (score.accuracy.value, score.area.value, score.brier) == (1.0, 1.0, 0.0)
    assert (score.windows, score.positive, score.answered) == (6 * 190, 6 * 140, 1.0)
    assert (score.events, score.found, score.false_alarms) == (60, 1.0, 0.0)
    assert score.delay == pytest.approx((0.1, 0.1))
    slip = detection(oracle(), "slip")
    assert (slip.accuracy.value, slip.area.value, slip.events) == (1.0, 1.0, 30)
    assert slip.windows == 6 * 140


def test_shuffled_answers_are_chance(oracle: Oracle) -> None:
    results = oracle()
    draw = np.random.default_rng(2).uniform(size=len(results))
    score = detection(told(results, "slip", draw), "slip")
    assert score.area.value == pytest.approx(0.5, abs=0.06)
    assert score.area.low is not None
    assert score.area.high is not None
    assert score.area.low < 0.5 < score.area.high
    assert score.accuracy.value == pytest.approx(0.5, abs=0.06)


def test_who_always_says_yes_finds_nothing_for_free(oracle: Oracle) -> None:
    results = oracle()
    score = detection(told(results, "contact", np.ones(len(results))), "contact")
    assert score.accuracy.value == pytest.approx(140 / 190)
    assert score.area.value == 0.5
    assert score.found == 0.0
    assert score.false_alarms is not None
    assert score.false_alarms > 0.0


def test_a_detector_that_is_late_has_its_delay_told(oracle: Oracle) -> None:
    results = oracle()
    late = np.nan_to_num(results.label("contact"))  # the window of the onset is missed
    assert detection(told(results, "contact", late), "contact").delay == pytest.approx((0.2, 0.2))


def test_false_alarms_are_counted_for_each_quiet_minute(oracle: Oracle) -> None:
    results = oracle()
    quiet = np.flatnonzero(results.label("contact") == 0.0)
    values = np.nan_to_num(results.label("contact"), nan=1.0)
    values[quiet[1::5]] = 1.0  # one in each untouched stretch of 0.5 s, apart from the touches
    score = detection(told(results, "contact", values), "contact")
    assert score.quiet == pytest.approx(0.1 * quiet.size)
    assert score.false_alarms == pytest.approx(60.0 * 60 / (0.1 * quiet.size))


def test_an_abstention_counts_as_wrong(oracle: Oracle) -> None:
    results = oracle()
    values = results.estimate("contact").copy()
    values[::4] = np.nan
    score = detection(told(results, "contact", values), "contact")
    assert score.accuracy.value == score.answered
    assert score.answered == pytest.approx(0.75, abs=0.03)


def test_what_is_not_estimated_is_not_scored(oracle: Oracle) -> None:
    results = replace(oracle(), value={})
    score = detection(results, "contact")
    assert (score.windows, score.accuracy.value, score.events) == (6 * 190, None, 0)


def test_a_number_that_is_no_probability_is_refused(oracle: Oracle) -> None:
    results = oracle()
    with pytest.raises(InputError, match=r"estimates of contact from .* probabilities"):
        detection(told(results, "contact", 2.0 * results.estimate("contact")), "contact")


def test_sliding_is_told_by_speed_beside_all_rest(oracle: Oracle) -> None:
    results = oracle()
    assert np.nanmax(speed(results)) == 0.01
    bands = by_speed(results)
    assert list(bands) == ["0.01 to 0.02"]
    (told,) = bands.values()
    assert (told.windows, told.found.value, told.area.value) == (6 * 70, 1.0, 1.0)
    assert by_speed(replace(results, value={})) == {}


def test_a_speed_that_is_missed_is_told_apart(oracle: Oracle) -> None:
    results = oracle()
    slow = (np.arange(len(results)) // 20 % 4 == 1) & (results.label("slip") == 1.0)
    across = np.where(slow, 0.001, results.label("slip_across"))
    truth = {**results.truth, "slip_across": across}
    missed = replace(results, truth=truth, value={"slip": np.where(slow, 0.1, results.estimate("slip"))})
    bands = by_speed(missed, draws=0)
    assert [band.found.value for band in bands.values()] == [0.0, 1.0]
    silent = by_speed(
        replace(missed, value={"slip": np.where(slow, np.nan, results.estimate("slip"))}), draws=0
    )
    assert [band.found.value for band in silent.values()] == [0.0, 1.0]
    assert [band.area.value for band in silent.values()] == [None, 1.0]
