import time

import numpy as np
import pytest

from monochord.capture.instruments import _arrivals
from monochord.capture.instruments._arrivals import Arrivals, convert

HOUR = 3600.0
STAMPS = 1000.0 + np.array(
    [10.001, 10.004, 10.009]
)  # the wall clock is 1000 s ahead; polls at 10.0 and 10.01


def test_stamps_become_monotonic_times() -> None:
    assert np.allclose(convert(STAMPS, (1000.0, 1000.0), 10.0, 10.01), STAMPS - 1000.0)


@pytest.mark.parametrize("step", [HOUR, -0.5])
def test_of_a_clock_that_was_set_each_stamp_is_read_by_the_offset_of_its_moment(step: float) -> None:
    set_between = STAMPS + np.array([0.0, step, step])
    assert np.allclose(convert(set_between, (1000.0 + step, 1000.0), 10.0, 10.01), STAMPS - 1000.0)


@pytest.mark.parametrize("stamp", [np.nan, 0.0, 1e12])
def test_a_stamp_that_fits_no_offset_becomes_now(stamp: float) -> None:
    assert convert(np.array([stamp]), (1000.0, 1000.0), 10.0, 10.01).tolist() == [10.01]


def test_a_step_smaller_than_a_poll_costs_no_more_than_itself() -> None:
    got = convert(STAMPS, (1000.002, 1000.0), 10.0, 10.01)
    assert np.all(np.abs(got - (STAMPS - 1000.0)) <= 0.0021)


def test_times_never_go_back_and_never_beyond_now(monkeypatch: pytest.MonkeyPatch) -> None:
    true = _arrivals.clock_offsets()["realtime"]
    steps = iter([0.0, 0.0, HOUR, HOUR, -HOUR, 0.0])
    monkeypatch.setattr(_arrivals, "clock_offsets", lambda: {"realtime": true + next(steps)})
    arrivals = Arrivals()
    last = -np.inf
    for _ in range(5):
        time.sleep(0.002)
        times = arrivals.times(np.array([time.time(), time.time()]))
        assert last <= times[0] <= times[1] <= time.monotonic()
        last = times[1]
