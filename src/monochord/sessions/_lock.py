"""Who may write a session: one program at a time, which holds a lock on the file while it does."""

import fcntl
import os
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from monochord.core.errors import InputError
from monochord.core.units import Seconds

PATIENCE: Seconds = 0.3
"""How long a lock is tried for: whoever only looks whether there is one holds it for an instant."""


def lock(handle: int) -> bool:
    """Lock an open file for writing; return false where another program, or another part of this one, has it.

    The lock goes when the file is closed, or the program ends, however it does. A file system without locks
    is taken to have no second writer.
    """
    return _locked(handle, fcntl.LOCK_EX, PATIENCE)


def refuse_recorded(path: Path, handle: int) -> None:
    """Lock an open session for writing; raises `InputError` where it is being recorded or repaired."""
    if not lock(handle):
        given = f"session {path} (being recorded, or repaired by another program)"
        raise InputError(given, "one that nobody writes", "wait for the end of that")


def being_written(path: Path) -> bool:
    """Return whether a program records or repairs a session now."""
    with _reading(path) as handle:
        return not _locked(handle, fcntl.LOCK_SH, 0.0)


@contextmanager
def _reading(path: Path) -> Generator[int]:
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        yield handle
    finally:
        os.close(handle)


def _locked(handle: int, kind: int, patience: Seconds) -> bool:
    deadline = time.monotonic() + patience
    while True:
        try:
            fcntl.flock(handle, kind | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > deadline:
                return False
            time.sleep(0.01)
        except OSError:
            return True
        else:
            return True
