import numpy as np
import pytest

from monochord.lab.arrivals import Line, arrive

TAKEN = np.arange(20000) / 1000.0


def test_none_comes_before_its_delay_and_none_overtakes() -> None:
    index, arrival = arrive(TAKEN, Line(delay=0.02, jitter=2e-3), np.random.default_rng(0))
    late = arrival - TAKEN[index]
    assert len(index) == TAKEN.size
    assert late.min() == pytest.approx(0.02, abs=1e-5)
    assert late.mean() > 0.022
    assert (np.diff(arrival) >= 0.0).all()


def test_a_share_is_lost() -> None:
    index, arrival = arrive(TAKEN, Line(lost=0.01), np.random.default_rng(0))
    assert len(index) == len(arrival)
    assert TAKEN.size - len(index) == pytest.approx(200, abs=60)
    assert (np.diff(index) > 0).all()


def test_none_overtakes_those_of_before() -> None:
    _, arrival = arrive(np.array([1.0, 1.1]), Line(), np.random.default_rng(0), latest=1.05)
    assert arrival.tolist() == [1.05, 1.1]
