"""Arrays of a training run that are larger than memory: in files without a name, read block by block."""

import mmap
import os
from pathlib import Path
from tempfile import TemporaryFile

import numpy as np

from monochord.core.files import written
from monochord.core.types import Audio


class FileArray(np.ndarray[tuple[int, ...], np.dtype[np.float32]]):
    """An array in a file, of which `release` can let the memory go; views share the file."""

    pages: mmap.mmap | None = None

    def __array_finalize__(self, obj: object) -> None:
        self.pages = getattr(obj, "pages", None)


def empty(folder: Path | None, shape: tuple[int, ...]) -> Audio:
    """Return an array of zeros in a file in `folder`, which vanishes with the array; None: in memory.

    Raises `OSError` if the disk has no room for it: a page that cannot be written would end the process.

    >>> empty(None, (2, 3)).shape
    (2, 3)
    """
    if folder is None or 0 in shape:
        return np.zeros(shape, np.float32)
    size = int(np.prod(shape)) * np.dtype(np.float32).itemsize
    with TemporaryFile(dir=folder) as file:
        with written(folder):
            file.truncate(size)
            if hasattr(os, "posix_fallocate"):  # as on Linux
                os.posix_fallocate(file.fileno(), 0, size)
        pages = mmap.mmap(file.fileno(), size)
    array = np.frombuffer(pages, np.float32).reshape(shape).view(FileArray)
    array.pages = pages
    return array


def release(*arrays: Audio) -> None:
    """Let the memory of arrays in files go; what they hold is read again from the file.

    >>> release(np.zeros(3, np.float32))
    """
    for array in arrays:
        if isinstance(array, FileArray) and array.pages is not None:
            array.pages.madvise(mmap.MADV_DONTNEED)
