"""The disk under a recording: how long it will last, and writing through to it beside the loop."""

import errno
import os
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from monochord.core.errors import InputError
from monochord.core.units import Seconds

THROUGH: Seconds = 1.0
"""From one writing through to the disk to the next."""
TELLING: Seconds = 1.0
"""How much of a recording tells how fast it grows."""
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """How a recording fills its disk: bytes `free`, `size` of the file, and seconds `left` at this pace."""

    free: float
    size: float
    left: Seconds


def free_bytes(folder: Path) -> float:
    """Return what a user may still write below a folder, in bytes."""
    found = os.statvfs(folder)
    return float(found.f_bavail * found.f_frsize)


def space(folder: Path, *, size: float, elapsed: Seconds, reserve: float) -> Space:
    """Return how long the disk lasts until `reserve` bytes are left, judged by what was written so far.

    >>> space(Path("/"), size=0.0, elapsed=5.0, reserve=0.0).left
    inf
    """
    free = free_bytes(folder)
    pace = size / elapsed if elapsed >= TELLING else 0.0
    return Space(free=free, size=size, left=max(free - reserve, 0.0) / pace if pace else float("inf"))


def refuse_place(path: Path, least: float) -> None:
    """Refuse a file that exists, a folder that does not, and a disk with less than `least` bytes free."""
    if path.exists():
        raise InputError(
            f"file '{path}' (exists)", "a new file", "choose another name; nothing is overwritten"
        )
    if not path.parent.is_dir():
        raise InputError(f"file '{path}'", "a file in a folder that exists", f"make '{path.parent}' first")
    free = free_bytes(path.parent)
    if free < least:
        given = f"disk of '{path}' with {1e-6 * free:.0f} MB free"
        raise InputError(given, f"{1e-6 * least:.0f} MB or more", "make room, or set disk.start")


def is_full(error: OSError) -> bool:
    """Tell whether an error says that nothing more can be written there."""
    return error.errno in _FULL


@contextmanager
def written_through(sync: Callable[[], None]) -> Generator[list[OSError]]:
    """Call `sync` once a second from a thread of its own, so that a slow disk holds nobody up.

    Yields the list of what went wrong; after the first error it is not called again.
    """
    stopped, errors = threading.Event(), list[OSError]()

    def run() -> None:
        while not (stopped.wait(THROUGH) or errors):
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
