"""Scores follow known rules: an oracle is perfect, a guess is chance, an abstention is a miss."""

from dataclasses import replace

import numpy as np
import pytest
from tests.evaluation.conftest import Oracle

from monochord.core.errors import InputError
from monochord.evaluation.results import Results, Trial
from monochord.evaluation.scores import (
    blocks_of,
    by_speed,
    detection,
    regression,
    regression_rows,
    score_of,
    speed,
)

TOUCHED, KNOWN = 6 * 140, 6 * 190
"""Windows of the oracle: touched at known positions, and with a known contact."""


def with_estimates(results: Results, name: str, values: np.ndarray) -> Results:
    return replace(results, value={**results.value, name: values})


@pytest.mark.parametrize("name", ["position", "force"])
def test_an_oracle_has_no_errors(oracle: Oracle, name: str) -> None:
    score = regression(oracle(), name)
    assert (score.answered, score.mae.value, score.within.value) == (1.0, 0.0, 1.0)
    assert score.r.value == pytest.approx(1.0, abs=1e-12)
    assert (score.bias, score.median, score.covered) == (0.0, 0.0, (1.0, 1.0))
    assert (score.windows, score.sessions, score.blocks) == (TOUCHED, 6, "sessions")


def test_shuffled_estimates_are_chance(oracle: Oracle) -> None:
    results = oracle()
    rows = regression_rows(results, "position")
    values = results.estimate("position").copy()
    values[rows] = np.random.default_rng(1).permutation(values[rows])
    score = regression(with_estimates(results, "position", values), "position")
    assert score.r.value == pytest.approx(0.0, abs=0.1)
    truth = results.label("position")[rows]
    assert score.mae.value == pytest.approx(np.mean(np.abs(truth[:, None] - truth)), rel=0.1)
    draw = np.random.default_rng(2).uniform(size=len(results))
    slip = detection(with_estimates(results, "slip", draw), "slip")
    assert slip.accuracy.value == pytest.approx(0.5, abs=0.06)
    low, high = slip.area.low, slip.area.high
    assert low is not None
    assert high is not None
    assert 0.44 < low < 0.5 < high < 0.56


def test_an_abstention_is_a_miss(oracle: Oracle) -> None:
    results = oracle()
    values = results.estimate("force").copy()
    values[np.flatnonzero(regression_rows(results, "force"))[::4]] = np.nan
    force = regression(with_estimates(results, "force", values), "force")
    assert force.answered == force.within.value == pytest.approx(0.75)
    assert force.mae.value == 0.0
    values = results.estimate("contact").copy()
    values[::4] = np.nan
    contact = detection(with_estimates(results, "contact", values), "contact")
    assert contact.accuracy.value == contact.answered == pytest.approx(0.75, abs=0.03)


def test_untouched_and_incomplete_windows_are_not_scored(oracle: Oracle) -> None:
    results = oracle()
    values = np.where(regression_rows(results, "position"), results.label("position"), 99.0)
    assert regression(with_estimates(results, "position", values), "position").mae.value == 0.0
    half = replace(results, usable=np.arange(len(results)) % 2 == 0)
    assert regression(half, "position").windows < 0.6 * TOUCHED


def test_intervals_draw_sessions_or_stretches_of_time(oracle: Oracle) -> None:
    assert len(np.unique(blocks_of(oracle())[0])) == 6
    blocks, what = blocks_of(oracle(objects=("plastic",) * 3))
    assert (len(np.unique(blocks)), what) == (6, "stretches of 10 s")
    assert score_of(lambda at: float(at.size), np.zeros(5, np.int64)).low is None


def test_a_session_that_is_worse_widens_the_interval(oracle: Oracle) -> None:
    results = oracle(spread=1.0)
    values = results.estimate("position") + np.where(results.trial == 0, 0.01, 0.0)
    widths: list[float] = []
    for each in (results, with_estimates(results, "position", values)):
        mae = regression(each, "position").mae
        assert mae.low is not None
        assert mae.high is not None
        widths.append(mae.high - mae.low)
    assert widths[1] > 10.0 * widths[0]


def test_without_windows_or_estimates_there_are_no_scores(oracle: Oracle) -> None:
    results = oracle()
    none = regression(results, "position", np.zeros(len(results), bool))
    assert (none.windows, none.mae.value, none.answered) == (0, None, None)
    silent = regression(with_estimates(results, "position", np.full(len(results), np.nan)), "position")
    assert (silent.answered, silent.within.value, silent.mae.value) == (0.0, 0.0, None)
    contact = detection(replace(results, value={}), "contact")
    assert (contact.windows, contact.accuracy.value, contact.events) == (KNOWN, None, 0)


def test_other_quantities_and_other_numbers_are_refused(oracle: Oracle) -> None:
    results = oracle()
    with pytest.raises(InputError, match=r"'torque'.*position, force"):
        regression(results, "torque")
    with pytest.raises(InputError, match="contact"):
        detection(with_estimates(results, "contact", 2.0 * results.estimate("contact")), "contact")


def test_an_oracle_detects_every_event_at_its_first_window(oracle: Oracle) -> None:
    score = detection(oracle(), "contact")
    assert (score.accuracy.value, score.area.value, score.brier) == (1.0, 1.0, 0.0)
    assert (score.windows, score.positive, score.answered) == (KNOWN, TOUCHED, 1.0)
    assert (score.events, score.detected, score.false_alarms) == (60, 1.0, 0.0)
    assert score.delay == pytest.approx((0.1, 0.1))
    slip = detection(oracle(), "slip")
    assert (slip.windows, slip.accuracy.value, slip.area.value, slip.events) == (TOUCHED, 1.0, 1.0, 30)


def test_a_late_detector_has_a_longer_delay(oracle: Oracle) -> None:
    results = oracle()
    late = np.nan_to_num(results.label("contact"))  # misses the window of the onset
    assert detection(with_estimates(results, "contact", late), "contact").delay == pytest.approx((0.2, 0.2))


def test_always_yes_detects_no_event(oracle: Oracle) -> None:
    results = oracle()
    score = detection(with_estimates(results, "contact", np.ones(len(results))), "contact")
    assert score.accuracy.value == pytest.approx(140 / 190)
    assert (score.area.value, score.detected) == (0.5, 0.0)
    assert score.false_alarms is not None
    assert score.false_alarms > 0.0


@pytest.mark.parametrize(
    ("touched", "alarm", "detected", "delay", "alarms"),
    [
        ([*range(8, 13)], 11, 1.0, (0.875, 0.875), 0),  # known at 1.875 s, before the event's end at 2 s
        ([*range(8, 13)], 12, 0.0, (), 1),  # known at 2 s, when the event is over
        ([*range(8, 13), *range(15, 18)], 11, 0.5, (0.0, 0.0), 0),  # the next event begins at 1.875 s
    ],
)
def test_an_event_lasts_to_the_end_of_its_last_window(
    touched: list[int], alarm: int, detected: float, delay: tuple[float, ...], alarms: int
) -> None:
    at = np.arange(20)
    contact, value = np.isin(at, touched).astype(float), (at == alarm).astype(float)
    results = Results(
        estimator="by hand",
        window=0.5,
        hop=0.125,
        trials=(Trial(session="take"),),
        trial=np.zeros(20, np.int32),
        start=at / 8.0,
        usable=np.ones(20, bool),
        truth={"contact": contact},
        value={"contact": value},
        std={},
        reason_index={},
    )
    score = detection(results, "contact", draws=0)
    quiet = (20 - len(touched)) / 8.0
    assert (score.events, score.detected, score.delay) == (round(len(touched) / 4), detected, delay)
    assert (score.quiet, score.false_alarms) == (quiet, 60.0 * alarms / quiet)


def test_false_alarms_are_counted_per_quiet_minute(oracle: Oracle) -> None:
    results = oracle()
    quiet = np.flatnonzero(results.label("contact") == 0.0)
    values = np.nan_to_num(results.label("contact"), nan=1.0)
    values[quiet[1::5]] = 1.0  # one in each untouched stretch of 0.5 s, apart from the touches
    score = detection(with_estimates(results, "contact", values), "contact")
    assert score.quiet == pytest.approx(0.1 * quiet.size)
    assert score.false_alarms == pytest.approx(60.0 * 60 / (0.1 * quiet.size))


def test_each_band_of_speeds_is_scored_against_all_rest(oracle: Oracle) -> None:
    results = oracle()
    assert np.nanmax(speed(results)) == 0.01
    (band,) = by_speed(results).values()
    assert (band.windows, band.detected.value, band.area.value) == (6 * 70, 1.0, 1.0)
    assert by_speed(replace(results, value={})) == {}
    slow = (np.arange(len(results)) // 20 % 4 == 1) & (results.label("slip") == 1.0)
    across = np.where(slow, 0.001, results.label("slip_across"))
    results = replace(results, truth={**results.truth, "slip_across": across})
    for estimate, area in ((0.1, 0.0), (np.nan, None)):
        missed = np.where(slow, estimate, results.estimate("slip"))
        bands = by_speed(replace(results, value={"slip": missed}), draws=0)
        assert [band.detected.value for band in bands.values()] == [0.0, 1.0]
        areas = [band.area.value for band in bands.values()]
        assert areas[1] == 1.0
        assert (areas[0] is None) == (area is None)
