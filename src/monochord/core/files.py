"""Reading of finite files only, and writing that never leaves half a file under the final name."""

import os
import re
import stat
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from difflib import get_close_matches
from pathlib import Path

from monochord.core.errors import InputError
from monochord.core.printable import printable

MAX_NAME = 100
"""Characters of a file's name that the one beside it repeats."""
_KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFCHR: "a device", stat.S_IFBLK: "a disk", stat.S_IFSOCK: "a socket"}
_INDEX = re.compile(r"|Unnamed: \d+")


def refuse_endless(path: Path) -> None:
    """Raise `InputError` where a path is a pipe, a device or a socket: reading it may take for ever.

    What is not there, and folders, pass: whoever opens them says so.

    >>> refuse_endless(Path("/dev/zero"))
    Traceback (most recent call last):
    monochord.core.errors.InputError: file /dev/zero (a device): expected a file on a disk; save it first
    """
    try:
        kind = _KINDS.get(stat.S_IFMT(path.stat().st_mode))
    except OSError:
        return
    if kind:
        raise InputError(f"file {path} ({kind})", "a file on a disk", "save it first")


def similar_name(path: Path | str, names: Iterable[str] = ()) -> str:
    """Return ``did you mean 'x'?`` if something with a similar name exists, else an empty string.

    Parameters
    ----------
    path
        The path that was asked for and does not exist.
    names
        What else may be meant, beside what lies in the same folder and has the same suffix.

    >>> similar_name("dmeo", ["demo"])
    "did you mean 'demo'?"
    """
    path = Path(path)
    meant = {name: name for name in names}
    with suppress(OSError, ValueError):  # of a folder that cannot be read, and of a name that none can have
        if path.exists():
            return ""
        beside = [entry for entry in path.parent.iterdir() if entry.suffix == path.suffix]
        meant = {entry.stem: printable(str(entry)) for entry in beside} | meant
    close = get_close_matches(path.stem, meant, n=1, cutoff=0.6)
    return f"did you mean '{meant[close[0]]}'?" if close else ""


def without_index(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Return the rows of a table, header first, without the row numbers that pandas writes before them.

    Its header names them not at all, or, written a second time, ``Unnamed: 0``.

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
    """Yield a file beside `path` to write, which takes its place at once as the context ends.

    If that ends with an error, or is never reached, what was there before stays. The name that is written has
    the same suffix; a device or a pipe, such as ``/dev/stdout``, is written itself.

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
        yield part
        os.replace(part, path)  # noqa: PTH105  (replaces the file at once)
    except OSError as error:
        error.filename = str(path)  # that of `part` means nothing to a person
        raise
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def sound_written(path: Path) -> Generator[None]:
    """Raise `InputError` where libsndfile cannot write all of a sound file, as on a full disk."""
    import soundfile  # noqa: PLC0415  (loads its library on use)

    try:
        yield
    except soundfile.LibsndfileError as error:
        given = f"file {path} ({error.error_string.rstrip('.')})"
        raise InputError(
            given, "a place with enough space", "free space there, or write elsewhere"
        ) from error
