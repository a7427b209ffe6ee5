"""Reads only finite files, and never leaves an incomplete file under its final name."""

import errno
import os
import re
import stat
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO

from monochord.core.errors import InputError, closest
from monochord.core.printable import printable

MAX_NAME = 100
"""Most characters of a file's name reused in the temporary name beside it."""
MAX_PART, MAX_PATH = 255, 4095
"""Most bytes of a name, and of a whole path, on the usual file systems."""
_KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFCHR: "a device", stat.S_IFBLK: "a disk", stat.S_IFSOCK: "a socket"}
_CANNOT_SYNC = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOTTY)
_INDEX = re.compile(r"|Unnamed: \d+")


def refuse_endless(path: Path) -> None:
    """Raise `InputError` for a pipe, a device or a socket, which may never end.

    Missing files and folders pass: opening them raises the appropriate error.

    >>> refuse_endless(Path("/dev/zero"))
    Traceback (most recent call last):
    monochord.core.errors.InputError: file /dev/zero (a device): expected a file on a disk; save it first
    """
    refuse_impossible(path, "file")
    try:
        kind = _KINDS.get(stat.S_IFMT(path.stat().st_mode))
    except OSError:
        return
    if kind:
        raise InputError(f"file {path} ({kind})", "a file on a disk", "save it first")


def refuse_impossible(path: Path | str, what: str = "path") -> None:
    r"""Raise `InputError` for a path that no file system takes: too long, or with a zero byte.

    >>> refuse_impossible("take\0.wav")
    Traceback (most recent call last):
    monochord.core.errors.InputError: path with a zero byte: expected the path of a file or folder
    """
    try:
        name = os.fsencode(path)
    except UnicodeEncodeError as error:
        raise InputError(f"{what} {str(path)!a}", "the path of a file or folder") from error
    longest = max(map(len, name.split(b"/")))
    if b"\0" in name:
        raise InputError(f"{what} with a zero byte", "the path of a file or folder")
    if longest > MAX_PART or len(name) > MAX_PATH:
        given = f"{what} of {len(name)} bytes, {longest} in one name"
        raise InputError(given, f"{MAX_PATH} at most, {MAX_PART} in one name")


def similar_name(path: Path | str, names: Iterable[str] = ()) -> str:
    """Return ``did you mean 'x'?`` if something has a name like that of a missing path, else an empty string.

    Candidates are files of its suffix in its folder, and `names`.

    >>> similar_name("dmeo", ["demo"])
    "did you mean 'demo'?"
    """
    path = Path(path)
    meant = {name.lower(): name for name in names}
    with suppress(OSError, ValueError):  # of a folder that cannot be read, and of a name that none can have
        if path.exists():
            return ""
        beside = [entry for entry in path.parent.iterdir() if entry.suffix == path.suffix]
        meant = {entry.stem.lower(): printable(str(entry)) for entry in beside} | meant
    close = closest(path.stem, meant)
    return "" if close is None else f"did you mean '{meant[close]}'?"


def without_index(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Return the rows of a table, header first, without pandas's column of row numbers.

    The header leaves that column's name empty or, after a second export, calls it ``Unnamed: 0``.

    >>> without_index([["", "time"], ["0", "0.5"]])
    [['time'], ['0.5']]
    """
    table = [[*row] for row in rows]
    while table and len(table[0]) > 1 and _INDEX.fullmatch(table[0][0].strip()):
        if not all(row and row[0].strip().isdecimal() for row in table[1:]):
            break
        table = [row[1:] for row in table]
    return table


@contextmanager
def replacing(path: Path) -> Generator[Path]:
    """Yield a temporary file beside `path` to write; it replaces `path` when the context ends.

    If the context ends with an error, or never ends, the previous file stays. The temporary name has the same
    suffix; a device or a pipe, such as ``/dev/stdout``, is written directly.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(Path(folder) / "a.txt") as part:
    ...         _ = part.write_text("whole")
    ...     (Path(folder) / "a.txt").read_text(), len(os.listdir(folder))
    ('whole', 1)
    """
    if path.exists() and not path.is_file():
        yield path
        return
    path = path.resolve()  # where a link points, so that the link stays
    part = path.with_name(f".part-{os.getpid()}-{path.name[-MAX_NAME:]}")
    try:
        with written(path):
            yield part
            os.replace(part, path)  # noqa: PTH105  (replaces the file at once)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a whole text to `path`, as `replacing` does."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


@contextmanager
def written(path: Path) -> Generator[None]:
    """Let an `OSError` name the file that is being written, as where the disk is full.

    >>> with written(Path("take.csv")):
    ...     raise OSError(errno.ENOSPC, "No space left on device")
    Traceback (most recent call last):
    OSError: [Errno 28] No space left on device: 'take.csv'
    """
    try:
        yield
    except OSError as error:
        # NumPy gives no number where less was written than it asked for.
        number = error.errno or errno.ENOSPC
        raise OSError(number, os.strerror(number), str(path)) from error


def refuse_existing(path: Path, remedy: str = "choose another name, or remove it") -> None:
    """Raise `InputError` where a file is there already."""
    if path.exists():
        raise InputError(f"file '{path}', which already exists", "a new file", remedy)


def new_text(path: Path, **options: Any) -> TextIO:
    """Open a text file for new content, as `Path.open` does; a pipe or an empty file may be there already.

    Raises `InputError` where a file with content is there, or none can be written.
    """
    with usable_path(f"file {path}", "a writable path"):
        if path.is_file() and path.stat().st_size:
            refuse_existing(path)
        return path.open("w", encoding="utf-8", **options)


@contextmanager
def usable_path(what: str, expected: str) -> Generator[None]:
    """Raise `InputError` for `what`, such as ``folder out``, where the system refuses to read or write it."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{what} ({error.strerror})", expected) from error


def synced(handle: int) -> None:
    """Wait until the bytes of an open file are on the disk, where its file system can tell."""
    try:
        os.fdatasync(handle)
    except OSError as error:
        if error.errno not in _CANNOT_SYNC:
            raise


@contextmanager
def sound_written(path: Path) -> Generator[None]:
    """Raise `InputError` where libsndfile cannot write a whole sound file, as on a full disk."""
    import soundfile  # noqa: PLC0415  (loads its library on use)

    try:
        yield
    except soundfile.LibsndfileError as error:
        given = f"file {path} ({error.error_string.rstrip('.')})"
        raise InputError(
            given, "a file that can be written", "free space there, or write elsewhere"
        ) from error
