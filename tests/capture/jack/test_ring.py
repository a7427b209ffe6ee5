import os
import threading
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monochord.capture.jack.arena import OVERFLOWED, WAKE, Arena
from monochord.capture.jack.ring import FRAME_TIME_SPAN, Period, Ring, frames_between


def period(begin: int, frames: int, channels: int = 2) -> Period:
    samples = begin + np.arange(frames) + 1000.0 * np.arange(channels)[:, None]
    return Period(samples=samples.astype(np.float32), frame_time=begin, microseconds=begin * 7)


@settings(deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.integers(1, 40)), max_size=200))
def test_it_gives_back_in_order_what_fitted_and_counts_what_did_not(steps: list[tuple[bool, int]]) -> None:
    ring, queue, begin, refused = Ring(2, 100, shortest=8), list[Period](), 0, 0
    for write, frames in steps:
        if write:
            sent = period(begin, frames)
            begin += frames
            if ring.put(sent):
                queue.append(sent)
            else:
                refused += frames
        elif queue:
            sent, got = queue.pop(0), ring.take()
            assert got is not None
            assert np.array_equal(got.samples, sent.samples)
            assert (got.frame_time, got.microseconds) == (sent.frame_time, sent.microseconds)
        else:
            assert ring.take() is None
        assert ring.pending == sum(waiting.samples.shape[1] for waiting in queue)
    assert ring.arena.count(OVERFLOWED) == refused
    ring.arena.close()


def test_it_holds_at_least_what_it_was_made_for() -> None:
    ring = Ring(1, 100, shortest=10)
    assert all(ring.put(period(10 * k, 10, channels=1)) for k in range(10))
    ring.arena.close()


def test_it_refuses_when_headers_run_out() -> None:
    ring = Ring(1, 64, shortest=32)
    assert [ring.put(period(k, 1, channels=1)) for k in range(4)] == [True, True, False, False]
    ring.arena.close()


def test_what_was_taken_is_not_overwritten() -> None:
    ring = Ring(1, 16)
    assert ring.put(period(0, 16, channels=1))
    first = ring.take()
    assert ring.put(period(500, 16, channels=1))
    assert first is not None
    assert first.samples[0, 0] == 0.0
    ring.arena.close()


@given(st.integers(0, FRAME_TIME_SPAN - 1), st.integers(-(2**31), 2**31 - 1))
def test_frames_between_survives_the_wrap(earlier: int, step: int) -> None:
    assert frames_between(earlier, (earlier + step) % FRAME_TIME_SPAN) == step


def test_wake_ends_a_wait_from_another_thread_and_is_remembered_once() -> None:
    arena = Arena(1, 16, 2)
    threading.Timer(0.05, arena.wake).start()
    arena.wait(1e6)
    arena.wake()
    arena.wait(1e6)  # woken before: returns at once
    began = time.monotonic()
    arena.wait(0.05)
    assert time.monotonic() - began >= 0.04
    for _ in range(2):
        arena.close()
    arena.wake()


def test_an_arena_that_nobody_holds_gives_its_descriptor_back() -> None:
    arena = Arena(1, 16, 2)
    descriptor = int(arena.words[WAKE])
    os.fstat(descriptor)
    del arena
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(descriptor)
