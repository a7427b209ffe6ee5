"""Block checksums of a dataset's files, so that damage is found without reading everything."""

import errno
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from monochord.core.errors import DeviceError, InputError, MonochordError

BLOCK = 1 << 20
"""Bytes covered by one checksum."""
DIGITS = 16
"""Hexadecimal digits of SHA-256 stored per block: 64 bits, enough against damage."""
REMEDY = "build the dataset again"
LIMITS = {
    errno.EMFILE: "raise it, such as with: ulimit -n 4096",
    errno.ENFILE: "end programs that hold many files open",
    errno.ENOMEM: "end programs that use much memory",
}
"""What to do where a machine is short of something, which says nothing about the file, by error number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileSums:
    """Size of a file and the checksums of its 1 MiB blocks in order; the last block may be shorter."""

    bytes: int
    blocks: tuple[str, ...]


def file_sums(file: Path) -> FileSums:
    """Return a file's size and checksums."""
    with file.open("rb") as stream:
        blocks = tuple(_sum(block) for block in iter(lambda: stream.read(BLOCK), b""))
        return FileSums(bytes=stream.tell(), blocks=blocks)


def check_blocks(folder: Path, files: Mapping[str, FileSums], chosen: Iterable[tuple[str, int]]) -> None:
    """Compare blocks of files, each a name and a number, with their checksums.

    Raises `InputError` for the first file that differs or cannot be read.
    """
    for name, number in chosen:
        file = folder / name
        try:
            with file.open("rb") as stream:
                stream.seek(number * BLOCK)
                actual = _sum(stream.read(BLOCK))
        except OSError as error:
            raise unreadable(file, error) from error
        if actual != files[name].blocks[number]:
            at = f"wrong checksum of the bytes from {number * BLOCK} on"
            raise InputError(f"{file} (damaged: {at})", "the unchanged file", REMEDY)


def unreadable(file: Path, error: OSError) -> MonochordError:
    """Return the error for a dataset's file that cannot be read; only a missing file is called so.

    >>> print(unreadable(Path("audio/0000.npy"), OSError(errno.EMFILE, "Too many open files")))
    audio/0000.npy (Too many open files): a limit of this machine; raise it, such as with: ulimit -n 4096
    """
    if error.errno in LIMITS:
        return DeviceError(f"{file} ({error.strerror}): a limit of this machine; {LIMITS[error.errno]}")
    if isinstance(error, FileNotFoundError):
        return InputError(f"{file} (missing)", "a whole dataset", REMEDY)
    return InputError(f"{file} ({error.strerror})", "a readable file")


def _sum(block: bytes) -> str:
    return sha256(block).hexdigest()[:DIGITS]
