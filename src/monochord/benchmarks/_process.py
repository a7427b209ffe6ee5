"""Cores and memory of the running process."""

import os
from collections.abc import Generator, Iterable
from contextlib import contextmanager, suppress
from pathlib import Path

from monochord.core.errors import InputError


@contextmanager
def one_core() -> Generator[None]:
    """Keep every thread of this process on one core."""
    if not hasattr(os, "sched_setaffinity"):
        raise InputError(f"a machine of kind {os.name}", "Linux, to keep the benchmark on one core")
    threads = [int(task.name) for task in Path("/proc/self/task").iterdir()]
    before = os.sched_getaffinity(0)
    _pin(threads, {max(before)})
    try:
        yield
    finally:
        _pin(threads, before)


def resident() -> float:
    """Return the resident memory in MB."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _pin(threads: Iterable[int], cores: set[int]) -> None:
    for thread in threads:
        with suppress(ProcessLookupError):  # it ended meanwhile
            os.sched_setaffinity(thread, cores)
