"""A recording's disk: time until it is full, and background syncing."""

import errno
import os
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from monochord.core.errors import InputError
from monochord.core.units import Seconds

SYNC_INTERVAL: Seconds = 1.0
"""Time between two syncs to the disk."""
MIN_ELAPSED: Seconds = 1.0
"""Shortest recording from which the growth rate is known, in s."""
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@dataclass(frozen=True, slots=True, kw_only=True)
class DiskSpace:
    """Space on a disk: bytes `free`, `size` of the file, and seconds `left` at the present rate."""

    free: float
    size: float
    left: Seconds


def free_bytes(folder: Path) -> float:
    """Return the free bytes for this user below a folder."""
    status = os.statvfs(folder)
    return float(status.f_bavail * status.f_frsize)


def space(folder: Path, *, size: float, elapsed: Seconds, reserve: float) -> DiskSpace:
    """Return the disk space, with the time until only `reserve` bytes are left at the rate so far.

    >>> space(Path("/"), size=0.0, elapsed=5.0, reserve=0.0).left
    inf
    """
    free = free_bytes(folder)
    rate = size / elapsed if elapsed >= MIN_ELAPSED else 0.0
    return DiskSpace(free=free, size=size, left=max(free - reserve, 0.0) / rate if rate else float("inf"))


def refuse_place(path: Path, min_free: float) -> None:
    """Raise `InputError` for an existing file, a missing folder, or less than `min_free` free bytes."""
    if path.exists():
        raise InputError(
            f"file '{path}' (exists)",
            "a new file",
            "choose another name; existing files are never overwritten",
        )
    if not path.parent.is_dir():
        raise InputError(f"file '{path}'", "a file in an existing folder", f"create '{path.parent}' first")
    free = free_bytes(path.parent)
    if free < min_free:
        given = f"disk of '{path}' with {1e-6 * free:.0f} MB free"
        raise InputError(given, f"{1e-6 * min_free:.0f} MB or more", "free some space, or set disk.start")


def is_full(error: OSError) -> bool:
    """Return whether an error means that the disk, or the file, is full."""
    return error.errno in _FULL


@contextmanager
def written_through(sync: Callable[[], None]) -> Generator[list[OSError]]:
    """Call `sync` once a second from a separate thread, so that a slow disk blocks nothing.

    Yields the list of errors; after the first error, `sync` is not called again.
    """
    stopped, errors = threading.Event(), list[OSError]()

    def run() -> None:
        while not (stopped.wait(SYNC_INTERVAL) or errors):
            try:
                sync()
            except OSError as error:
                errors.append(error)

    thread = threading.Thread(target=run, name="record sync", daemon=True)
    thread.start()
    try:
        yield errors
    finally:
        stopped.set()
        thread.join()
