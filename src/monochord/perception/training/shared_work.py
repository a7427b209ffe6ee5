"""Processes that help with work whose results are cached: each begins elsewhere, skips what is there."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from multiprocessing.process import BaseProcess


@contextmanager
def helped(work: Callable[[int], object], count: int) -> Generator[None]:
    """Let a process on every other core do pieces 0 to `count` - 1 of some work, until the context is left.

    Whoever enters it does all pieces in order meanwhile, and finds those that others did in the cache. With
    one helper, who begins at the end, the two meet. A piece that two begin at once is done twice.

    Helpers are copies of this process (fork), so that neither data nor scripts need be prepared for them. On
    other systems than Linux, and in processes that help themselves, there are none.

    Parameters
    ----------
    work
        Does a piece and keeps its result where the same call finds it.
    count
        Pieces.
    """
    is_alone = sys.platform != "linux" or multiprocessing.parent_process() is not None
    helpers = 0 if is_alone else min(len(os.sched_getaffinity(0)), count) - 1
    started: list[BaseProcess] = []
    try:
        for number in range(helpers):
            arguments = work, _order(count, number, helpers), os.getpid()
            process = multiprocessing.get_context("fork").Process(target=_help, args=arguments, daemon=True)
            process.start()
            started.append(process)
        yield
    finally:
        for process in started:
            process.kill()  # what can be handled would be, by what this process had set up
            process.join()


def _order(count: int, number: int, helpers: int) -> range:
    """Return the pieces that a helper does, backwards from its share of the whole.

    >>> [list(_order(6, number, 2)) for number in range(2)]
    [[5, 4, 3, 2, 1, 0], [2, 1, 0]]
    """
    return range(count * (helpers - number) // helpers - 1, -1, -1)


def _help(work: Callable[[int], object], order: range, parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Control-C goes to all, and the parent ends its helpers
    for number in order:
        if os.getppid() != parent:
            return
        try:
            work(number)
        except Exception:  # noqa: BLE001  (the parent comes to the same piece, and says so)
            return
