"""The output file of a session: unbuffered, with disk space reserved ahead for its ending."""

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
from weakref import finalize

from monochord.core.errors import InputError
from monochord.core.files import refuse_endless, similar_name, synced, written
from monochord.core.units import Seconds

KEEP_SIZE = 1  # of fallocate(2): blocks are set aside, the file's size stays
RESERVE = 4 << 20
"""Bytes reserved beyond the file's end and its ending, so that the file can always be finished."""
MIN_SIZE_LIMIT = 2 << 20
"""Smallest file size limit under which a session starts, in bytes."""
NEXT_WRITE = 3 << 19
"""Bytes kept free below a file size limit for the next write."""


class SessionFile:
    """A new file; every write reaches the system at once, so nothing is lost if the program is killed.

    Space is reserved ahead of the end where the file system supports it. `full` is the error number once no
    more space is available, 0 until then: ENOSPC, or EFBIG where the size of files is limited by the system
    (``ulimit -f``) or the file system (4 GB on FAT32). The reserved space still holds a valid ending.
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
            raise InputError(f"file {path} ({error.strerror})", "a writable file") from error
        self._release = finalize(self, os.close, self._handle)  # the lock, too, of a writer that is dropped
        lock(self._handle)  # nobody else can have one that is new
        _sync_name(path)
        self.reserve()

    def write(self, data: Any) -> int:
        """Write all bytes; raises `OSError` where the system refuses."""
        view, done = memoryview(data).cast("B"), 0
        with written(self.path):
            while done < len(view):
                done += os.write(self._handle, view[done:])
        self._size += done
        return done

    def read(self, offset: int, count: int) -> bytes:
        """Return `count` bytes already written, or as many as there are."""
        return os.pread(self._handle, count, offset)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._size

    def flush(self) -> None:
        """Do nothing: there is no buffer."""

    def reserve(self, ending: int = 0) -> None:
        """Reserve at least this many bytes beyond the end for an ending; set `full` where that fails."""
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
        """Wait until all bytes are on the disk."""
        with written(self.path):
            synced(self._handle)

    def close(self) -> None:
        """Release the reserved space and close; a second call does nothing."""
        if self._handle >= 0:
            handle, self._handle = self._handle, -1
            try:
                os.ftruncate(handle, self._size)
            finally:
                self._release()


def size_limit() -> int:
    """Return the system's current file size limit of this process, in bytes."""
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return sys.maxsize if limit == resource.RLIM_INFINITY else limit


def _sync_name(path: Path) -> None:
    """Wait until the folder entry is on the disk, so that the file keeps its name after a power cut."""
    with suppress(OSError):  # not every file system can
        folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _fallocate(handle: int, offset: int, length: int) -> int:
    """Return 0, or the system's error number."""
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
"""Time to retry a lock, in s: a check for a lock holds it for an instant."""


def lock(handle: int) -> bool:
    """Lock an open file for writing; return false where a writer already holds the lock.

    The lock ends when the file is closed or the program ends in any way. A file system without locks is
    assumed to have no second writer.
    """
    return _locked(handle, fcntl.LOCK_EX, LOCK_TIMEOUT)


def refuse_recorded(path: Path, handle: int) -> None:
    """Lock an open session for writing; raises `InputError` while it is being recorded or repaired."""
    if not lock(handle):
        given = f"session {path} (being recorded, or repaired by another program)"
        raise InputError(given, "a file that no process is writing", "wait until it is finished")


def being_written(path: Path) -> bool:
    """Return whether a program is recording or repairing a session now.

    Raises `InputError` for a file that does not exist or cannot be read.
    """
    refuse_endless(path)
    with _reading(path) as handle:
        return not _locked(handle, fcntl.LOCK_SH, 0.0)


def unreadable(path: Path, error: OSError) -> InputError:
    """Return the error for a session that the system does not open."""
    remedy = similar_name(path) or "check its name"
    return InputError(f"file {path} ({error.strerror})", "a session (.mcap)", remedy)


@contextmanager
def _reading(path: Path) -> Generator[int]:
    try:
        handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise unreadable(path, error) from error
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
