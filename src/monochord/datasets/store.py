"""A dataset on disk: audio and a table of windows, memory-mapped.

::

    manifest.json            what it is made of, and the label rules
    audio/SESSION.npy        (2, n) float32: all of a session; lost frames are zeros
    windows/COLUMN.npy       (windows,): session, start, has_gap, clipped, not_finite
    labels/COLUMN.npy        (windows,) float64: contact, position, force ...; NaN where not valid
    valid/COLUMN.npy         (windows,) bool: where the label is valid

Everything is plain NumPy, so that any program can read it. Audio is kept once and windows are cut from it
when they are asked for, so that a smaller hop costs no space.
"""

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.datasets.manifest import Manifest
from monochord.errors import InputError, did_you_mean
from monochord.types import Audio, Floats
from monochord.units import Samples

Flags: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.int64]
TABLE: dict[str, type[np.generic]] = {
    "session": np.int32,
    "start": np.int64,
    "has_gap": np.bool_,
    "clipped": np.bool_,
    "not_finite": np.bool_,
}
"""Columns of the table of windows that are no labels."""
MOST_OPEN = 256
"""Audio files that are mapped at once: each holds one of the process's file descriptors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dataset:
    """Windows with labels, in the order of their sessions and of time.

    `session` (n,) numbers `manifest.parts`; `start` (n,) is the first frame of each window in its session.
    `has_gap`, `clipped` and `not_finite` (n,) tell what is wrong with its samples. `labels` and `valid` map
    a column's name to (n,). A dataset that is pickled, as for a worker process, is opened again there.
    """

    path: Path
    manifest: Manifest
    session: NDArray[np.int32]
    start: Indices
    has_gap: Flags
    clipped: Flags
    not_finite: Flags
    labels: Mapping[str, Floats]
    valid: Mapping[str, Flags]
    _tracks: OrderedDict[int, Audio] = field(default_factory=OrderedDict[int, Audio], repr=False)

    def __len__(self) -> int:
        return len(self.start)

    def __reduce__(self) -> tuple[Any, ...]:
        return open_dataset, (self.path,)

    @property
    def usable(self) -> Flags:
        """Windows (n,) whose every sample was recorded and is a number."""
        return ~(self.has_gap | self.not_finite)

    def audio(self, session: int) -> Audio:
        """Return all samples (2, n) of a session, memory-mapped and read-only."""
        tracks = self._tracks
        if session in tracks:
            return tracks[session]
        while len(tracks) >= MOST_OPEN:
            tracks.popitem(last=False)
        tracks[session] = self.mapped(session)
        return tracks[session]

    def mapped(self, session: int) -> Audio:
        """Return the same in a mapping of its own, which goes with it: for one pass over all sessions."""
        return np.asarray(_mapped(self.path / self.manifest.parts[session].audio))

    def window(self, index: int) -> Audio:
        """Return the samples (2, frames) of a window: a view of the file, read-only."""
        start = int(self.start[index])
        return self.audio(int(self.session[index]))[:, start : start + self.manifest.window]

    def batch(self, indices: NDArray[np.integer[Any]]) -> Audio:
        """Return a copy of the samples (k, 2, frames) of k windows."""
        samples = np.empty((len(indices), self.manifest.channels, self.manifest.window), np.float32)
        for row, index in enumerate(indices.tolist()):
            samples[row] = self.window(index)
        return samples

    def label(self, name: str) -> Floats:
        """Return a column (n,) of labels, NaN where not valid; raises `InputError` where there is none."""
        if name not in self.labels:
            raise InputError(f"label '{name}'", ", ".join(self.labels), did_you_mean(name, self.labels))
        return self.labels[name]


def open_dataset(path: Path) -> Dataset:
    """Return the dataset in a folder, nothing of which but the manifest is read yet.

    Raises
    ------
    InputError
        If the folder holds no dataset, or not all of it.
    """
    path = Path(path).absolute()
    manifest = Manifest.read(path)

    def column(file: str) -> Any:
        values = np.asarray(_mapped(path / file))
        if values.shape != (manifest.windows,):
            given = f"{path / file} with {len(values)} rows"
            raise InputError(given, f"{manifest.windows} rows", "build the dataset again")
        return values

    return Dataset(
        path=path,
        manifest=manifest,
        **{name: column(f"windows/{name}.npy") for name in TABLE},
        labels={name: column(f"labels/{name}.npy") for name in manifest.columns},
        valid={name: column(f"valid/{name}.npy") for name in manifest.columns},
    )


def write_table(folder: Path, table: Mapping[str, NDArray[Any]], labels: Mapping[str, Floats]) -> None:
    """Write the columns of the table of windows and the labels, each (n,), with their masks."""
    for name in ("windows", "labels", "valid"):
        (folder / name).mkdir(exist_ok=True)
    for name, kind in TABLE.items():
        write_array(folder / "windows" / f"{name}.npy", table[name].astype(kind))
    for name, values in labels.items():
        write_array(folder / "labels" / f"{name}.npy", values.astype(np.float64))
        write_array(folder / "valid" / f"{name}.npy", np.isfinite(values))


def write_array(file: Path, values: NDArray[Any]) -> None:
    """Write an array as `numpy.save` does, but that errors name the file and tell a full disk as such."""
    values = np.ascontiguousarray(values)
    try:
        with file.open("wb") as out:
            np.lib.format.write_array_header_1_0(out, np.lib.format.header_data_from_array_1_0(values))
            out.write(values.reshape(-1).view(np.uint8).data)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(file)) from error


def window_starts(frames: Samples, window: Samples, hop: Samples) -> Indices:
    """Return the first frames of the windows that lie wholly in `frames`: every multiple of `hop`, as live.

    Examples
    --------
    >>> window_starts(10, 4, 3).tolist()
    [0, 3, 6]
    """
    return np.arange(0, max(frames - window + 1, 0), hop, dtype=np.int64)


def _mapped(file: Path) -> NDArray[Any]:
    try:
        return np.load(file, mmap_mode="r") if file.stat().st_size > 128 else np.load(file)
    except (OSError, ValueError, EOFError) as error:
        raise InputError(f"{file} (absent or damaged)", "a whole dataset", "build it again") from error
