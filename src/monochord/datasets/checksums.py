"""Checksums of a dataset's files, block by block, so that damage is noticed without reading all."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from monochord.core.errors import InputError

BLOCK = 1 << 20
"""Bytes that one checksum covers."""
DIGITS = 16
"""Hexadecimal digits of SHA-256 that are stored of each block: 64 bits, against damage."""
REMEDY = "build the dataset again"


@dataclass(frozen=True, slots=True, kw_only=True)
class FileSums:
    """Size of a file and the checksum of each of its blocks of 1 MiB, in order; the last may be shorter."""

    bytes: int
    blocks: tuple[str, ...]


def file_sums(file: Path) -> FileSums:
    """Return size and checksums of a file."""
    with file.open("rb") as stream:
        blocks = tuple(_sum(block) for block in iter(lambda: stream.read(BLOCK), b""))
        return FileSums(bytes=stream.tell(), blocks=blocks)


def check_blocks(folder: Path, files: Mapping[str, FileSums], chosen: Iterable[tuple[str, int]]) -> None:
    """Compare blocks of files with their checksums.

    Parameters
    ----------
    folder
        Of the dataset.
    files
        Checksums by the names of the files below it.
    chosen
        Name and number of each block to be compared.

    Raises
    ------
    InputError
        Naming the first file that differs, or that cannot be read.
    """
    for name, number in chosen:
        file = folder / name
        try:
            with file.open("rb") as stream:
                stream.seek(number * BLOCK)
                own = _sum(stream.read(BLOCK))
        except OSError as error:
            raise InputError(f"{file} ({error.strerror})", "a readable file", REMEDY) from error
        if own != files[name].blocks[number]:
            at = f"bytes from {number * BLOCK} on have another checksum"
            raise InputError(f"{file} (damaged: {at})", "the file as it was built", REMEDY)


def _sum(block: bytes) -> str:
    return sha256(block).hexdigest()[:DIGITS]
