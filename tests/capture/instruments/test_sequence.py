from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from monochord.capture.instruments._sequence import Sequence

WRAP = 1 << 32


def follow(
    sequence: Sequence, counts: Any, ticks: Any = None, **options: Any
) -> tuple[list[int], list[bool]]:
    count = np.asarray(counts, np.int64)
    tick = count if ticks is None else np.asarray(ticks, np.int64)
    numbers, in_order = sequence.follow(count, tick, options.pop("time", count / 1000.0), **options)
    return numbers.tolist(), in_order.tolist()


@given(st.integers(0, WRAP - 1), st.lists(st.integers(1, 100), min_size=1, max_size=50), st.integers(1, 7))
def test_losses_are_gaps_and_gaps_are_losses_wherever_it_wraps(
    first: int, steps: list[int], batch: int
) -> None:
    true = first + np.cumsum(steps)
    sequence = Sequence(wraps=True, ticks=1.0, rate=1000.0)
    got: list[int] = []
    for start in range(0, true.size, batch):
        got += follow(sequence, true[start : start + batch] % WRAP)[0]
    assert np.array_equal(np.diff(got), np.diff(true))
    assert sequence.missing == sum(steps[1:]) - len(steps[1:])
    assert sequence.late == sequence.restarts == 0


@given(
    st.lists(st.integers(0, WRAP - 1), min_size=1, max_size=30),
    st.lists(st.integers(0, WRAP - 1), min_size=30),
)
def test_whatever_comes_numbers_go_up_and_account_for_all(counts: list[int], ticks: list[int]) -> None:
    sequence = Sequence(wraps=True, ticks=1.0, rate=1000.0, patience=7000.0)
    time = np.arange(len(counts)) / 1000.0
    numbers, ordered = follow(sequence, counts, ticks[: len(counts)], time=time)
    in_order = np.array(numbers)[ordered]
    assert np.all(np.diff(in_order) >= 1)
    assert sequence.missing == int(in_order[-1] - in_order[0]) + 1 - in_order.size
    assert sequence.late == len(counts) - in_order.size


def test_a_stream_begun_anew_is_carried_on_by_the_senders_clock() -> None:
    sequence = Sequence(wraps=True, ticks=7.0, rate=1000.0)
    follow(sequence, [100, 101], [700, 707])
    assert follow(sequence, [1, 2], [777, 784])[0] == [111, 112]
    assert (sequence.restarts, sequence.missing) == (1, 9)


def test_a_sender_that_was_away_is_carried_on_by_the_time() -> None:
    sequence = Sequence(wraps=True, ticks=1.0, rate=1000.0, patience=7000.0)
    follow(sequence, [100, 101], time=np.array([5.0, 5.001]))
    assert follow(sequence, [1, 2], away=True, time=np.array([6.001, 6.002]))[0] == [1101, 1102]
    assert sequence.restarts == 1


def test_late_and_repeated_readings_are_left_out() -> None:
    sequence = Sequence(patience=100.0)
    assert follow(sequence, [5, 6, 8, 7, 8, 9])[1] == [True, True, True, False, False, True]
    assert (sequence.late, sequence.missing, sequence.restarts) == (2, 1, 0)
