import math
import tracemalloc

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from monochord.core.timing import Histogram


@given(st.lists(st.floats(1e-6, 100.0), min_size=1, max_size=300))
def test_percentiles_are_within_one_percent_of_the_sorted_durations(durations: list[float]) -> None:
    histogram = Histogram()
    for duration in durations:
        histogram.add(duration)
    seen = histogram.percentiles()
    ordered = sorted(durations)
    for share, value in ((0.50, seen.p50), (0.95, seen.p95), (0.99, seen.p99)):
        exact = ordered[math.ceil(share * len(ordered)) - 1]
        assert exact * (1 - 1e-9) <= value <= exact * 1.0101
    assert seen.longest == ordered[-1]
    assert seen.count == len(ordered)


def test_nothing_seen_gives_nan_and_says_none() -> None:
    seen = Histogram().percentiles()
    assert seen.count == 0
    assert math.isnan(seen.p99)
    assert math.isnan(seen.longest)
    assert seen.line() == "none"


def test_durations_outside_the_range_are_still_counted() -> None:
    histogram = Histogram()
    for duration in (-1.0, 0.0, 1e-12, 1e9):
        histogram.add(duration)
    seen = histogram.percentiles()
    assert seen.count == 4
    assert seen.longest == 1e9
    assert seen.p50 <= 1.1e-7


def test_memory_is_fixed() -> None:
    histogram = Histogram()
    histogram.add(1.0)
    durations = np.random.default_rng(1).exponential(1e-3, 20_000).tolist()
    tracemalloc.start()
    for duration in durations:
        histogram.add(duration)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20_000
