"""Folders and files owned by one running process, and cleanup after ended processes.

Ownership is a `flock` lock, which the system releases when its process ends in any way: no lock is ever
stale, and a reused process number does no harm. Children do not inherit it, unless they are forked without
starting a program.
"""

import errno
import fcntl
import logging
import os
import re
import shutil
import tempfile
import uuid
from collections.abc import Generator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from monochord.core.errors import InputError

LOCK = ".monochord.lock"
"""Lock file in a folder that one run at a time may write; it holds the process number of that run."""
PREFIX = "monochord-scratch-"
MARK = ".monochord-scratch"
"""Marker file in a temporary folder created by Monochord, unlike a user's folder of the same name."""
_log = logging.getLogger("monochord")


@contextmanager
def sole_use(folder: Path, *, anywhere: bool = False) -> Generator[None]:
    """Own an existing folder until the context ends; `anywhere` also on a disk without locks, unguarded.

    `InputError` refuses a folder that another run owns, or whose disk does not support locks.
    """
    with _owned(folder / LOCK, folder, anywhere=anywhere):
        yield


@contextmanager
def _owned(file: Path, folder: Path, *, anywhere: bool) -> Generator[None]:
    """Lock the file that stands for a folder, and remove it at the end."""
    number = _locked(file, folder, anywhere=anywhere)
    try:
        with suppress(OSError):  # on a full disk the lock is as good without the number
            os.truncate(number, 0)
            os.write(number, f"{os.getpid()}\n".encode())
        yield
    finally:
        file.unlink(missing_ok=True)  # before the lock is released: see `_locked`
        os.close(number)


def _locked(file: Path, folder: Path, *, anywhere: bool) -> int:
    """Return the descriptor of a locked file; raises `InputError` where another process holds the lock."""
    while True:
        try:
            number = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:  # a person knows the folder, not its lock
            raise OSError(error.errno, error.strerror, str(folder)) from error
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            owner = os.read(number, 20).decode("ascii", "replace").strip() or "unknown"
            os.close(number)
            raise InputError(
                f"folder '{folder}' (process {owner} is writing to it)",
                "a folder that no other run writes to",
                "wait until that run has ended, or choose another folder",
            ) from error
        except OSError as error:
            if anywhere:
                return number
            os.close(number)
            given = f"folder '{folder}' (its disk does not support locks: {error.strerror})"
            raise InputError(given, "a folder on a disk with file locks") from error
        if _is(number, file):
            return number
        os.close(number)  # the run before removed it between our opening and our locking


@contextmanager
def part_folder(out: Path) -> Generator[Path]:
    """Yield a new folder beside `out` to fill and rename; if it still exists at the end, it is removed.

    Leftovers of ended processes for the same `out` are removed first, with a warning in the log. `InputError`
    refuses an `out` that another run is filling.
    """
    with _owned(out.absolute().parent / f".{out.name}{LOCK}", out, anywhere=True), _part_folder(out) as part:
        try:
            yield part
        except OSError as error:  # a person knows the folder by its own name
            number = error.errno or errno.ENOSPC
            named = Path(os.fsdecode(error.filename2 or error.filename or part))
            file = out / named.relative_to(part) if named.is_relative_to(part) else named
            raise OSError(number, os.strerror(number), str(file)) from error
        except InputError as error:
            given = error.given.replace(str(part), str(out))
            raise InputError(given, error.expected, error.remedy) from error


@contextmanager
def _part_folder(out: Path) -> Generator[Path]:
    ours = re.compile(re.escape(f".{out.name}.part-") + r"\d+(-[0-9a-f]{8})?")
    parent = out.absolute().parent
    _remove_abandoned(each for each in parent.iterdir() if ours.fullmatch(each.name))
    part = parent / f".{out.name}.part-{os.getpid()}-{uuid.uuid4().hex[:8]}"
    number: int | None = None
    try:
        while number is None or not _is(number, part):  # another's cleaning may come before our lock
            if number is not None:
                os.close(number)
            with suppress(FileExistsError):
                part.mkdir()
            number = _own(part)
        yield part
    finally:
        if part.exists():
            shutil.rmtree(part)
        if number is not None:
            os.close(number)


@contextmanager
def scratch_folder() -> Generator[Path]:
    """Yield a new temporary folder; it is removed at the end.

    Leftovers of this user's ended processes are removed first, with a warning in the log.
    """
    place = Path(tempfile.gettempdir())
    _remove_abandoned(each for each in place.glob(f"{PREFIX}*") if _is_ours(each))
    with tempfile.TemporaryDirectory(prefix=PREFIX) as name:
        folder = Path(name)
        number = _own(folder)
        try:
            (folder / MARK).touch()  # locked before: without its mark nobody removes it
            yield folder
        finally:
            if number is not None:
                os.close(number)


def _remove_abandoned(folders: Iterator[Path]) -> None:
    """Remove folders without an owner; those that cannot be read or locked are kept."""
    for folder in folders:
        with suppress(OSError):
            number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
                size = sum(file.lstat().st_size for file in folder.rglob("*"))
                shutil.rmtree(folder)
                _log.warning(
                    "monochord: removed %s (%.1f MB), left by a run that was killed", folder, 1e-6 * size
                )
            finally:
                os.close(number)


def _is_ours(folder: Path) -> bool:
    """Return whether a temporary folder was created by a Monochord process of this user."""
    with suppress(OSError):
        return folder.lstat().st_uid == os.getuid() and (folder / MARK).is_file()
    return False


def _own(folder: Path) -> int | None:
    """Own a folder and return its descriptor; None where it is gone, or its disk has no locks."""
    try:
        number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except FileNotFoundError:
        return None
    with suppress(OSError):
        fcntl.flock(number, fcntl.LOCK_EX)
    return number


def _is(number: int, path: Path) -> bool:
    """Return whether a descriptor refers to the file at a path."""
    with suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(number), path.stat())
    return False
