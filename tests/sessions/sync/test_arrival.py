"""When readings were taken: known times are found again behind jitter, bunches, losses and restarts."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.sessions.sync.arrival import line_under, times_taken


@dataclass(frozen=True, kw_only=True)
class Sent:
    """What a sender sent: its counts, when it took them, and when they arrived."""

    count: "np.ndarray"
    taken: Floats
    arrival: Floats
    rate: float
    ppm: float


LATENCY = 2e-4


def sent(
    seed: int = 0,
    *,
    rate: float = 7000.0,
    seconds: float = 20.0,
    jitter: float = 3e-4,
    bunch: float = 0.0,
    stalls: int = 3,
    steps: tuple[tuple[float, float], ...] = (),
) -> Sent:
    """Steps are (share of the whole, seconds by which the sender's clock leaps)."""
    rng = np.random.default_rng(seed)
    ppm = rng.uniform(-100.0, 100.0)
    count = np.arange(round(seconds * rate))
    taken = 100.0 + count / (rate * (1.0 + 1e-6 * ppm))
    arrival = taken + LATENCY + rng.exponential(jitter, taken.size)
    if bunch > 0.0:
        arrival = np.ceil(arrival / bunch) * bunch
    for begin in rng.uniform(taken[0], taken[-1], stalls):
        delayed = (taken > begin) & (taken < begin + 0.2)
        arrival[delayed] = np.maximum(arrival[delayed], begin + 0.2)
    for share, leap in steps:
        count[round(share * count.size) :] += round(leap * rate)
    received = rng.random(taken.size) > 0.01
    return Sent(count=count[received], taken=taken[received], arrival=arrival[received], rate=rate, ppm=ppm)


def errors(case: Sent) -> Floats:
    estimate = times_taken(case.arrival, case.count, rate=case.rate)
    return estimate.time - case.taken - LATENCY


@pytest.mark.parametrize("seed", range(3))
def test_times_are_estimated_despite_jitter_stalls_and_losses(seed: int) -> None:
    case = sent(seed)
    estimate = times_taken(case.arrival, case.count, rate=case.rate)
    assert np.abs(errors(case)).max() < 1e-5
    assert (np.diff(estimate.time) > 0.0).all()
    (piece,) = estimate.pieces
    assert piece.ppm == pytest.approx(case.ppm, abs=1.0)
    assert piece.jitter_median == pytest.approx(3e-4 * np.log(2.0), rel=0.1)
    assert piece.jitter_p99 > 3e-4 * np.log(100.0) * 0.9


@pytest.mark.parametrize("bunch", [1e-3, 5e-3])
def test_packets_that_come_in_bunches_do_not_pull(bunch: float) -> None:
    worst = [np.abs(errors(sent(seed, bunch=bunch, jitter=1e-4))).max() for seed in range(2)]
    assert max(worst) < 1.5 / 7000.0


@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_times_of_a_slow_stream(rate: float) -> None:
    worst = [np.abs(errors(sent(seed, rate=rate, seconds=30.0))).max() for seed in range(2)]
    assert max(worst) < 1e-4


@pytest.mark.parametrize(("leap", "rate"), [(-5.0, 7000.0), (-0.02, 125.0), (0.02, 7000.0), (3600.0, 125.0)])
def test_a_clock_that_steps_begins_a_new_piece(leap: float, rate: float) -> None:
    for seed in range(2):
        case = sent(seed, rate=rate, stalls=0, steps=((0.4, leap),))
        case = replace(case, count=case.count + 10_000)
        estimate = times_taken(case.arrival, case.count, rate=rate)
        assert len(estimate.pieces) == 2
        assert case.count[estimate.pieces[1].first] - case.count[estimate.pieces[1].first - 1] != 1
        assert np.abs(errors(case)).max() < 2e-4
        assert (np.diff(estimate.time) > 0.0).all()


def test_a_count_that_restarts_twice_has_three_pieces() -> None:
    case = sent(3)
    count = case.count.copy()
    for share in (0.3, 0.7):
        cut = round(share * count.size)
        count[cut:] -= count[cut]
    case = replace(case, count=count)
    assert len(times_taken(case.arrival, count, rate=7000.0).pieces) == 3
    assert np.abs(errors(case)).max() < 1e-5


def test_a_stall_is_no_step_wherever_it_is() -> None:
    for seed in range(6):
        case = sent(seed, seconds=4.0, stalls=1)
        edge = case.taken[0] + 0.2 if seed % 2 else case.taken[-1]
        delayed = (case.taken > edge - 0.2) & (case.taken <= edge)
        arrival = np.where(delayed, np.maximum(case.arrival, edge), case.arrival)
        assert len(times_taken(arrival, case.count, rate=7000.0).pieces) == 1


def test_clocks_that_drift_apart_with_temperature_are_followed() -> None:
    rng = np.random.default_rng(5)
    count = np.arange(600 * 500)
    nominal = count / 500.0
    taken = nominal + 1e-3 * np.sin(2.0 * np.pi * nominal / 600.0)  # 10 ppm either way
    arrival = taken + rng.exponential(3e-4, taken.size)
    estimate = times_taken(arrival, count, rate=500.0)
    assert np.abs(estimate.time - taken).max() < 2e-4


def test_readings_that_overtook_each_other_keep_their_places() -> None:
    case = sent(1, seconds=5.0)
    arrival = case.arrival + np.random.default_rng(0).exponential(5e-4, case.arrival.size)
    order = np.argsort(arrival)
    estimate = times_taken(arrival[order], case.count[order], rate=7000.0)
    assert (np.diff(estimate.time) < 0.0).any()
    assert np.abs(estimate.time - case.taken[order] - LATENCY).max() < 2e-5


def test_without_a_count_arrivals_stand() -> None:
    arrival = np.array([1.0, 1.5, 1.5, 2.0])
    for count in (None, np.full(4, -1)):
        estimate = times_taken(arrival, count)
        assert estimate.pieces == ()
        assert np.abs(estimate.time - arrival).max() < 1e-8
        assert (np.diff(estimate.time) > 0.0).all()


def test_a_count_that_tells_nothing_of_time_is_not_believed() -> None:
    rng = np.random.default_rng(0)
    arrival = np.cumsum(rng.exponential(1.0, 300))
    estimate = times_taken(arrival, np.arange(300), rate=1.0)
    assert not all(piece.steady for piece in estimate.pieces)


def test_one_reading_and_none_are_taken_as_they_come() -> None:
    assert times_taken(np.array([4.0]), np.array([17]), rate=100.0).time.tolist() == [4.0]
    assert times_taken(np.zeros(0), np.zeros(0, np.int64), rate=100.0).time.size == 0


def test_what_does_not_fit_is_refused() -> None:
    for arrivals, count in ((np.zeros(3), np.zeros(2, np.int64)), (np.array([0.0, np.nan]), np.arange(2))):
        with pytest.raises(InputError):
            times_taken(arrivals, count)


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.integers(2, 60))
def test_the_line_under_a_cloud_is_the_solution_of_the_linear_programme(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-1.0, 1.0, count), rng.exponential(1.0, count)
    a, b = line_under(x, y)
    assert (a + b * x <= y + 1e-9).all()
    best = linprog(
        [-count, -x.sum()], A_ub=np.stack([np.ones(count), x], axis=1), b_ub=y, bounds=[(None, None)] * 2
    )
    assert count * a + b * x.sum() == pytest.approx(-best.fun, abs=1e-6)
