"""The file under a session that is being written: unbuffered, and always some way ahead of a full disk."""

import ctypes
import errno
import fcntl
import os
import resource
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from monochord.core.errors import InputError
from monochord.core.files import refuse_endless
from monochord.core.units import Seconds

KEEP_SIZE = 1  # of fallocate(2): blocks are set aside, the file's size stays
RESERVE = 4 << 20
"""Bytes that are set aside beyond the file's end and its ending, so that it can always be finished."""
MIN_SIZE_LIMIT = 2 << 20
"""The smallest limit on the size of files under which it is worth beginning."""
NEXT_WRITE = 3 << 19
"""Bytes below a limit on the size of files that the next writing may take."""


class SessionFile:
    """A new file; every write is with the system at once, so that nothing is lost if the program is killed.

    Space is set aside ahead of the end where the file system can do that. `full` is the error number with
    which no more was to be had, 0 until then: ENOSPC, or EFBIG where the size of files is limited, by the
    system (``ulimit -f``) or the file system (4 GB on FAT32). What is set aside then holds a good ending.
    """

    def __init__(self, path: Path) -> None:
        if size_limit() < MIN_SIZE_LIMIT:
            given = f"file {path} (files may have {size_limit()} bytes at most: ulimit -f)"
            raise InputError(given, f"{MIN_SIZE_LIMIT} bytes or more", "ulimit -f unlimited")
        self.path = path
        self.full = 0
        self._size = self._reserved = 0
        try:
            self._handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        except FileExistsError as error:
            raise InputError(f"file {path} (exists)", "a new file", "choose another name") from error
        except OSError as error:
            raise InputError(f"file {path} ({error.strerror})", "a file that can be written") from error
        lock(self._handle)  # nobody else can have one that is new
        _sync_name(path)
        self.reserve()

    def write(self, data: Any) -> int:
        """Write all of it; raises `OSError` where the system will not take it."""
        view, done = memoryview(data).cast("B"), 0
        while done < len(view):
            done += os.write(self._handle, view[done:])
        self._size += done
        return done

    def read(self, offset: int, count: int) -> bytes:
        """Return `count` bytes that were written, or as many as there are."""
        return os.pread(self._handle, count, offset)

    def tell(self) -> int:
        """Return how many bytes were written."""
        return self._size

    def flush(self) -> None:
        """Do nothing: nothing is buffered."""

    def reserve(self, ending: int = 0) -> None:
        """Set space aside ahead of the end for an ending of so many bytes and more; note if there is none."""
        if self.full:
            return
        if self._size + NEXT_WRITE + ending > size_limit():
            self.full = errno.EFBIG
            return
        if self._reserved - self._size - ending >= RESERVE // 2:
            return
        ahead = RESERVE + ending
        failure = _fallocate(self._handle, self._size, min(ahead, size_limit() - self._size))
        if failure in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            self.full = failure
        else:
            # A file system that cannot set space aside is taken at its word until a write fails.
            self._reserved = self._size + ahead

    def sync(self) -> None:
        """Wait until all is on the disk."""
        os.fdatasync(self._handle)

    def close(self) -> None:
        """Give back what was set aside and close; does no harm twice."""
        if self._handle >= 0:
            handle, self._handle = self._handle, -1
            try:
                os.ftruncate(handle, self._size)
            finally:
                os.close(handle)


def size_limit() -> int:
    """Return the system's present limit on the size of a file of this process, in bytes."""
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return sys.maxsize if limit == resource.RLIM_INFINITY else limit


def _sync_name(path: Path) -> None:
    """Wait until the folder lists the file, so that it has its name after a power cut."""
    with suppress(OSError):  # not every file system can
        folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _fallocate(handle: int, offset: int, length: int) -> int:
    """Return 0, or the error number with which the system refused."""
    call = _system_call()
    if call is None or call(handle, KEEP_SIZE, offset, length) == 0:
        return 0
    return ctypes.get_errno()


@cache
def _system_call() -> Any:
    call = getattr(ctypes.CDLL(None, use_errno=True), "fallocate", None)
    if call is not None:
        call.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64]
    return call


LOCK_TIMEOUT: Seconds = 0.3
"""How long a lock is tried for: whoever only looks whether there is one holds it for an instant."""


def lock(handle: int) -> bool:
    """Lock an open file for writing; return false where another program, or another part of this one, has it.

    The lock goes when the file is closed, or the program ends, however it does. A file system without locks
    is taken to have no second writer.
    """
    return _locked(handle, fcntl.LOCK_EX, LOCK_TIMEOUT)


def refuse_recorded(path: Path, handle: int) -> None:
    """Lock an open session for writing; raises `InputError` where it is being recorded or repaired."""
    if not lock(handle):
        given = f"session {path} (being recorded, or repaired by another program)"
        raise InputError(given, "a file that no process is writing", "wait until it is finished")


def being_written(path: Path) -> bool:
    """Return whether a program records or repairs a session now."""
    refuse_endless(path)
    with _reading(path) as handle:
        return not _locked(handle, fcntl.LOCK_SH, 0.0)


@contextmanager
def _reading(path: Path) -> Generator[int]:
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        yield handle
    finally:
        os.close(handle)


def _locked(handle: int, kind: int, timeout: Seconds) -> bool:
    deadline = time.monotonic() + timeout
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
