import os
import threading
import time

import numpy as np
import pytest

from monochord.capture.jack import arena as at
from monochord.capture.jack.arena import Arena


def test_its_parts_fill_the_memory_without_overlap() -> None:
    arena = Arena(2, 64, 4)
    assert arena.headers.shape == (4, at.HEADER)
    assert arena.samples.shape == (2, 64)
    assert arena.words.size == at.PORTS + 2 + 4 * at.HEADER + 64
    arena.samples[:] = np.nan
    arena.headers[:] = 7
    assert arena.words[: at.PORTS].max() == arena.address
    assert arena.ports == [0, 0]
    arena.close()


def test_wake_ends_a_wait_from_another_thread_and_is_remembered_once() -> None:
    arena = Arena(1, 16, 2)
    threading.Timer(0.05, arena.wake).start()
    began = time.monotonic()
    arena.wait(10.0)
    assert time.monotonic() - began < 10.0
    arena.wake()
    arena.wait(10.0)  # woken before: returns at once
    began = time.monotonic()
    arena.wait(0.05)
    assert time.monotonic() - began >= 0.04
    arena.close()
    arena.close()
    arena.wake()


def test_an_arena_that_nobody_holds_gives_its_descriptor_back() -> None:
    arena = Arena(1, 16, 2)
    descriptor = int(arena.words[at.WAKE])
    os.fstat(descriptor)
    del arena
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(descriptor)
