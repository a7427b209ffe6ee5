"""Intervals cover the truth about as often as they say, with few blocks too, and see through copies."""

from collections.abc import Callable
from math import erf

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.metrics import area_under_curve, bootstrap_interval, time_blocks
from monochord.metrics.bootstrap import Rows
from monochord.metrics.ranking import area_interval


@pytest.mark.parametrize(("sessions", "least"), [(4, 0.75), (8, 0.83), (30, 0.83)])
@pytest.mark.slow
def test_the_interval_covers_the_truth_as_often_as_it_says(sessions: int, least: float) -> None:
    covered, cases = 0, 150
    for seed in range(cases):
        stream = np.random.default_rng(seed)
        # Rows of a session share an offset: what varies is the session.
        error = np.repeat(stream.normal(1.0, 1.0, sessions), 6) + stream.normal(0.0, 0.3, 6 * sessions)
        low, high = bootstrap_interval(
            lambda rows, error=error: float(error[rows].mean()),
            np.repeat(np.arange(sessions), 6), seed=seed, draws=300, share=0.9,
        )  # fmt: skip
        covered += low <= 1.0 <= high
    # 90 % of 150 is 135; 83 % is nearly three standard deviations below. Four blocks tell of 82 %.
    assert covered >= least * cases


def test_the_interval_of_an_area_covers_the_true_area_as_often_as_it_says() -> None:
    # Runs shift by themselves; the true area of two normals one apart, with variances 1 + 1 each, is known.
    truth = 0.5 * (1.0 + erf(1.0 / 2.0 / 2.0**0.5))
    covered = 0
    for seed in range(60):
        stream = np.random.default_rng(seed)
        ones = [stream.normal(1.0 + stream.normal(), 1.0, 5) for _ in range(30)]
        others = [stream.normal(stream.normal(), 1.0, 5) for _ in range(30)]
        low, high = area_interval(ones, others, seed=seed, draws=100)
        covered += low <= truth <= high
    assert covered >= 50  # of 60, where 57 are expected: three deviations below


def test_a_run_that_is_drawn_twice_does_not_lift_the_interval_of_an_area() -> None:
    # Each of five runs is told well within itself, and others are far off: pairs of one run are always right.
    off: list[float] = []
    for seed in range(20):
        shifts = 10.0 * np.random.default_rng(seed).normal(size=(5, 1))
        ones, others = [*(shifts + 1.0)], [*shifts]
        low, high = area_interval(ones, others, seed=seed, draws=100, share=0.5)
        off.append(0.5 * (low + high) - area_under_curve(np.concatenate(ones), np.concatenate(others)))
    assert abs(np.mean(off)) < 0.03


def test_copies_of_rows_do_not_narrow_an_interval() -> None:
    stream = np.random.default_rng(0)
    error = stream.normal(size=12)
    ones, others = ([stream.normal(mean, 1.0, 1) for _ in range(20)] for mean in (1.0, 0.0))

    def intervals(times: int) -> list[tuple[float, float]]:
        copied = np.repeat(error, times)
        blocks = np.repeat(np.arange(12), times)
        mean = bootstrap_interval(lambda rows: float(copied[rows].mean()), blocks, seed=1, draws=200)
        runs = [[np.repeat(values, times) for values in each] for each in (ones, others)]
        return [mean, area_interval(*runs, seed=0)]

    np.testing.assert_allclose(intervals(9), intervals(1), rtol=0.0, atol=1e-12)


def test_blocks_may_have_names_and_stand_in_any_order() -> None:
    values = np.array([1.0, 5.0, 2.0, 6.0])
    named = bootstrap_interval(lambda rows: float(values[rows].max()), np.array(["b", "a", "b", "a"]), seed=0)
    assert named == (2.0, 6.0)


def test_the_same_seed_gives_the_same_interval() -> None:
    values, blocks = np.arange(20.0), np.arange(20) // 2

    def mean(rows: Rows) -> float:
        return float(values[rows].mean())

    once = bootstrap_interval(mean, blocks, seed=3)
    assert once == bootstrap_interval(mean, blocks, seed=3)
    assert once != bootstrap_interval(mean, blocks, seed=4)


def test_draws_without_a_value_are_left_out() -> None:
    truth = np.array([True, False, True, True, True])
    score = np.array([2.0, 1.0, 3.0, 0.5, 4.0])

    def area(rows: Rows) -> float:
        return area_under_curve(score[rows][truth[rows]], score[rows][~truth[rows]])

    low, high = bootstrap_interval(area, np.arange(5), seed=0)
    assert 0.0 <= low < high <= 1.0


def test_blocks_of_time_do_not_reach_over_sessions() -> None:
    session = np.repeat([7, 3], 5)
    blocks = time_blocks(session, np.tile([0.0, 0.9, 1.0, 1.5, 2.2], 2), 1.0)
    assert blocks.tolist() == [3, 3, 4, 4, 5, 0, 0, 1, 1, 2]


SOME, NONE = np.ones(3), np.zeros(0)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: bootstrap_interval(lambda _: 1.0, np.zeros(5), seed=0),
        lambda: bootstrap_interval(lambda _: 1.0, NONE, seed=0),
        lambda: bootstrap_interval(lambda _: 1.0, np.zeros((2, 2)), seed=0),
        lambda: bootstrap_interval(lambda _: 1.0, np.arange(2), seed=0, share=1.0),
        lambda: bootstrap_interval(lambda _: float("nan"), np.arange(5), seed=0, draws=100),
        lambda: time_blocks(np.zeros(2), np.zeros(2), 0.0),
        lambda: time_blocks(np.zeros(2), np.array([0.0, np.nan]), 1.0),
        lambda: area_interval([SOME], [], seed=0),
        lambda: area_interval([SOME], [NONE], seed=0),
    ],
)
def test_what_cannot_be_drawn_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
