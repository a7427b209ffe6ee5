"""The area under the curve is what it says it is, and its interval covers the truth."""

import json
from math import erf
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.metrics.ranking import area_interval, area_under_curve


def test_golden() -> None:
    golden = json.loads(Path(__file__).with_name("golden.json").read_text(encoding="utf-8"))
    score, yes = np.array(golden["rows"]["probability"]), np.array(golden["rows"]["kind"]) == 1
    result = area_under_curve(score[yes], score[~yes])
    assert result == pytest.approx(golden["expected"]["area_under_curve"], rel=0, abs=1e-12)


def test_the_area_is_the_share_of_pairs_in_order() -> None:
    stream = np.random.default_rng(0)
    positive, negative = stream.integers(0, 9, 40) / 4.0, stream.integers(0, 7, 55) / 4.0
    above = (positive[:, None] > negative).mean() + 0.5 * (positive[:, None] == negative).mean()
    assert area_under_curve(positive, negative) == pytest.approx(above, abs=1e-12)
    assert area_under_curve(negative, positive) == pytest.approx(1.0 - above, abs=1e-12)


def test_perfect_worthless_and_reversed() -> None:
    low, high = np.arange(5.0), np.arange(5.0) + 10.0
    assert area_under_curve(high, low) == 1.0
    assert area_under_curve(low, high) == 0.0
    assert area_under_curve(low, low) == 0.5


def test_any_rising_function_of_the_values_gives_the_same_area() -> None:
    stream = np.random.default_rng(1)
    a, b = stream.normal(0.5, 1.0, 30), stream.normal(0.0, 1.0, 30)
    assert area_under_curve(np.exp(3.0 * a), np.exp(3.0 * b)) == area_under_curve(a, b)


def test_the_interval_covers_the_true_area_as_often_as_it_says() -> None:
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


def test_windows_of_one_run_do_not_narrow_the_interval() -> None:
    stream = np.random.default_rng(2)
    ones = [stream.normal(1.0, 1.0, 1) for _ in range(20)]
    others = [stream.normal(0.0, 1.0, 1) for _ in range(20)]
    once = area_interval(ones, others, seed=0)
    repeated = area_interval([np.repeat(v, 9) for v in ones], [np.repeat(v, 9) for v in others], seed=0)
    assert repeated == pytest.approx(once, abs=1e-12)


def test_what_cannot_be_ranked_is_refused() -> None:
    some, none = np.ones(3), np.zeros(0)
    with pytest.raises(InputError, match="3 positive and 0 negative"):
        area_under_curve(some, none)
    with pytest.raises(InputError, match="numbers of both"):
        area_under_curve(some, np.array([np.nan]))
    with pytest.raises(InputError, match="1 and 0 runs"):
        area_interval([some], [], seed=0)
    with pytest.raises(InputError, match="both kinds"):
        area_interval([some], [none], seed=0)
