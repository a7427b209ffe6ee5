"""A dataset on disk: audio and a table of windows, memory-mapped.

::

    manifest.json            description, label rules, and checksums of all other files
    audio/SESSION.npy        (2, n) float32: all of a session; lost frames are zeros
    windows/COLUMN.npy       (windows,): session, start, has_gap, clipped, not_finite
    labels/COLUMN.npy        (windows,) float64: contact, position, force ...; NaN where not valid
    valid/COLUMN.npy         (windows,) bool: where the label is valid

Everything is plain NumPy, readable by any program. Audio is stored once, and windows are cut when they are
read, so that a smaller hop needs no extra space.
"""

from collections import OrderedDict
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from itertools import compress
from pathlib import Path
from stat import S_ISREG
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import DeviceError, InputError, did_you_mean
from monochord.core.files import written
from monochord.core.notebook import html_table, lines
from monochord.core.types import Audio, Flags, Floats, Indices
from monochord.core.units import Samples
from monochord.datasets.checksums import REMEDY, check_blocks, unreadable
from monochord.datasets.manifest import FILE, TABLE, Layout, Manifest, file_checksum, is_column_name

MAX_OPEN_FILES = 256
"""Most audio files mapped at once: each holds one of the process's file descriptors."""
TABLES = ("windows", "labels", "valid")
"""Folders of the arrays (windows,)."""
SAMPLED_BLOCKS = 128
"""Number of 1 MiB audio blocks compared with their checksums when a dataset is opened."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Dataset:
    """Windows with labels, in order of session and time.

    `session` (n,) is the index into `manifest.parts`; `start` (n,) is each window's first frame in its
    session. `has_gap`, `clipped` and `not_finite` (n,) flag faulty samples. `labels` and `valid` map a
    column's name to (n,). A pickled dataset, as for a worker process, is reopened there.
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

    def __repr__(self) -> str:
        return lines(*self.facts())

    def _repr_html_(self) -> str:
        return html_table(*self.facts())

    def facts(self) -> tuple[str, list[tuple[str, str]]]:
        """Return a title and the main facts about the dataset, as texts."""
        about = self.manifest
        bodies = dict.fromkeys(part.body for part in about.parts if part.body)
        seconds = sum(part.frames for part in about.parts) / about.sample_rate
        span, hop = (1e3 * frames / about.sample_rate for frames in (about.window, about.hop))
        labels = ", ".join(f"{name} {int(valid.sum())}" for name, valid in self.valid.items())
        return f"Dataset: {self.path.name}", [
            ("windows", f"{len(self)} of {span:g} ms every {hop:g} ms, {int(self.usable.sum())} usable"),
            (
                "sessions",
                f"{len(about.parts)}{', simulated' if about.simulated else ''}, {seconds:.1f} s of sound",
            ),
            ("sound", f"{about.channels} channels at {about.sample_rate} Hz"),
            ("touched by", ", ".join(bodies) or "not known"),
            ("labels", labels or "none"),
        ]

    def __reduce__(self) -> tuple[Any, ...]:
        return _reopened, (self.path,)

    @property
    def checksum(self) -> str:
        """SHA-256 of the manifest, which includes all checksums of sessions and arrays."""
        return file_checksum(self.path / FILE)

    @property
    def usable(self) -> Flags:
        """Mask (n,) of windows without lost or non-finite samples."""
        return ~(self.has_gap | self.not_finite)

    def rows_of(self, session: int) -> slice:
        """Return the rows of a session's windows."""
        part = self.manifest.parts[session]
        return slice(part.first, part.first + part.windows)

    def audio(self, session: int) -> Audio:
        """Return all samples (2, n) of a session, memory-mapped and read-only."""
        tracks = self._tracks
        if session in tracks:
            return tracks[session]
        while len(tracks) >= MAX_OPEN_FILES:
            tracks.popitem(last=False)
        try:
            tracks[session] = self.mapped(session)
        except DeviceError:  # this process may open fewer files
            tracks.clear()
            tracks[session] = self.mapped(session)
        return tracks[session]

    def mapped(self, session: int) -> Audio:
        """Return all samples (2, n) of a session in a new mapping, for a single pass over the sessions."""
        part = self.manifest.parts[session]
        return _mapped(self.path, part.audio, (np.float32, (self.manifest.channels, part.frames)))

    def verify(self) -> None:
        """Compare every byte with its checksum; raises `InputError` naming the first file that is damaged."""
        check_blocks(self.path, self.manifest.files, _blocks(self.manifest))

    def window(self, index: int) -> Audio:
        """Return a window's samples (2, frames): a read-only view of the file."""
        start = int(self.start[index])
        return self.audio(int(self.session[index]))[:, start : start + self.manifest.window]

    def batch(self, indices: NDArray[np.integer[Any]]) -> Audio:
        """Return a copy of the samples (k, 2, frames) of k windows."""
        samples = np.empty((len(indices), self.manifest.channels, self.manifest.window), np.float32)
        for row, index in enumerate(indices.tolist()):
            samples[row] = self.window(index)
        return samples

    def label(self, name: str) -> Floats:
        """Return a label column (n,), NaN where not valid; raises `InputError` for an unknown column."""
        if name not in self.labels:
            raise InputError(f"label '{name}'", ", ".join(self.labels), did_you_mean(name, self.labels))
        return self.labels[name]


def open_dataset(path: Path, *, sampled: int = SAMPLED_BLOCKS, seed: int | None = None) -> Dataset:
    """Open the dataset in a folder, and check that it is unchanged since it was built.

    Size and header of every file are checked, and all of the table and the labels, since they are small. Of
    the audio, `sampled` random blocks of 1 MiB are compared with their checksums; `Dataset.verify` compares
    every byte.

    Parameters
    ----------
    path
        Folder of the dataset.
    sampled
        Number of audio blocks to compare.
    seed
        Random seed of the choice; by default different each time.

    Raises
    ------
    InputError
        If the folder holds no complete dataset, or checked data are damaged.
    """
    path = Path(path).absolute()
    manifest = Manifest.read(path)
    arrays = dict[str, Any]()
    for name, layout in manifest.arrays():
        if _is_audio(name):  # mapped when it is read: a process may open some hundreds of files at once
            _check_header(path, name, layout)
        else:
            arrays[name] = _mapped(path, name, layout)
    check_blocks(path, manifest.files, (block for block in _blocks(manifest) if not _is_audio(block[0])))
    if sampled:
        count = sum(len(sums.blocks) for name, sums in manifest.files.items() if _is_audio(name))
        some = np.random.default_rng(seed).choice(count, size=min(sampled, count), replace=False)
        spoken = (block for block in _blocks(manifest) if _is_audio(block[0]))
        check_blocks(path, manifest.files, compress(spoken, np.isin(np.arange(count), some)))
    dataset = Dataset(
        path=path,
        manifest=manifest,
        session=arrays["windows/session.npy"],
        start=arrays["windows/start.npy"],
        has_gap=arrays["windows/has_gap.npy"],
        clipped=arrays["windows/clipped.npy"],
        not_finite=arrays["windows/not_finite.npy"],
        labels={name: arrays[f"labels/{name}.npy"] for name in manifest.columns},
        valid={name: arrays[f"valid/{name}.npy"] for name in manifest.columns},
    )
    _refuse_outside(dataset)
    return dataset


def _is_audio(name: str) -> bool:
    return name.partition("/")[0] not in TABLES


def _blocks(manifest: Manifest) -> Iterator[tuple[str, int]]:
    """Yield the file name and number of each block that has a checksum."""
    for name, sums in manifest.files.items():
        yield from ((name, number) for number in range(len(sums.blocks)))


def _reopened(path: Path) -> Dataset:
    """Return a dataset that another process has already opened and checked."""
    return open_dataset(path, sampled=0)


def _refuse_outside(dataset: Dataset) -> None:
    """Refuse a table with windows outside of their sessions' sound."""
    parts = dataset.manifest.parts
    counts, frames = np.array([(part.windows, part.frames) for part in parts], np.int64).reshape(-1, 2).T
    session = np.repeat(np.arange(len(parts), dtype=np.int32), counts)
    ends = frames[session] - dataset.manifest.window
    if not (
        np.array_equal(dataset.session, session) and np.all((dataset.start >= 0) & (dataset.start <= ends))
    ):
        raise InputError(
            f"{dataset.path / 'windows'} (windows outside of their sessions)",
            "the unchanged table of windows",
            REMEDY,
        )


def session_rows(table: Mapping[str, NDArray[Any]], labels: Mapping[str, Floats]) -> NDArray[np.void]:
    """Return a session's rows of the window table and its labels as one structured array (windows,).

    Raises `InputError` for a label name that is unusable as a file name.
    """
    for name in labels:
        if not is_column_name(name):
            raise InputError(f"label {name!r}", "a valid file name", "rename it in the sessions")
    kinds = {name: kind for name, kind in TABLE.items() if name in table}
    fields = [*kinds.items(), *((_label_field(name), np.float64) for name in labels)]
    rows = np.empty(len(table["start"]), fields)
    for name in kinds:
        rows[name] = table[name]
    for name, values in labels.items():
        rows[_label_field(name)] = values
    return rows


def write_table(folder: Path, sessions: Sequence[Path], windows: Samples, labels: Sequence[str]) -> None:
    """Write the window table and the labels with their masks, one session in memory at a time.

    `sessions` are the files of `session_rows`, in order, of `windows` rows in all; a label that a session
    lacks is NaN there.
    """
    kinds = {f"windows/{name}": kind for name, kind in TABLE.items()}
    kinds |= {f"labels/{name}": np.float64 for name in labels} | {
        f"valid/{name}": np.bool_ for name in labels
    }
    for name in TABLES:
        (folder / name).mkdir(exist_ok=True)
    with ExitStack() as stack:
        write = {
            name: stack.enter_context(_array_writer(folder / f"{name}.npy", (kind, (windows,))))
            for name, kind in kinds.items()
        }
        for number, file in enumerate(sessions):
            rows = np.load(file)
            write["windows/session"](np.full(len(rows), number, np.int32))
            for name in TABLE:
                if name != "session":
                    write[f"windows/{name}"](rows[name])
            for name in labels:
                known = _label_field(name) in rows.dtype.names
                values = rows[_label_field(name)] if known else np.full(len(rows), np.nan)
                write[f"labels/{name}"](values)
                write[f"valid/{name}"](np.isfinite(values))


def _label_field(name: str) -> str:
    """Return the field of a label in `session_rows`, unlike any of the table's."""
    return f"labels/{name}"


def write_array(file: Path, values: NDArray[Any]) -> None:
    """Write an array as `numpy.save` does; errors name the file, and report a full disk."""
    with _array_writer(file, (values.dtype, values.shape)) as write:
        write(values)


@contextmanager
def _array_writer(file: Path, layout: Layout) -> Generator[Callable[[NDArray[Any]], None]]:
    """Yield the function that appends to an array's file; errors name the file, and report a full disk."""
    with file.open("wb", buffering=0) as out:

        def write(values: NDArray[Any]) -> None:
            put(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data)

        def put(data: memoryview) -> None:
            with written(file):
                while data:  # of which the disk may take less at once
                    data = data[out.write(data) :]

        put(memoryview(_header(layout)))
        yield write


def window_starts(frames: Samples, window: Samples, hop: Samples) -> Indices:
    """Return the first frames of the windows complete in `frames`: every multiple of `hop`, as live.

    >>> window_starts(10, 4, 3).tolist()
    [0, 3, 6]
    """
    return np.arange(0, max(frames - window + 1, 0), hop, dtype=np.int64)


def _header(layout: Layout) -> bytes:
    """Return the header bytes of a .npy file for such an array."""
    kind, shape = layout
    header = {"descr": np.lib.format.dtype_to_descr(np.dtype(kind)), "fortran_order": False, "shape": shape}
    out = BytesIO()
    np.lib.format.write_array_header_1_0(out, header)
    return out.getvalue()


def _check_header(folder: Path, name: str, layout: Layout) -> int:
    """Compare the size and the header of a file with its array's, and return the header's size in bytes."""
    file, header, (kind, shape) = folder / name, _header(layout), layout
    size = len(header) + int(np.prod(shape, dtype=object)) * np.dtype(kind).itemsize
    try:
        status = file.stat()
        if not S_ISREG(status.st_mode) or status.st_size != size:
            given = f"{file} (damaged: {status.st_size} bytes)"
            raise InputError(given, f"the dataset's file of {size} bytes", REMEDY)
        with file.open("rb") as stream:
            if stream.read(len(header)) != header:
                given = f"{file} (damaged: its header differs)"
                raise InputError(given, f"a .npy array of {np.dtype(kind).name} {shape}", REMEDY)
    except OSError as error:
        raise unreadable(file, error) from error
    return len(header)


def _mapped(folder: Path, name: str, layout: Layout) -> NDArray[Any]:
    """Return a file's array, memory-mapped; the header is compared, not interpreted."""
    begin, (kind, shape) = _check_header(folder, name, layout), layout
    if 0 in shape:
        return np.zeros(shape, kind)
    try:
        return np.asarray(np.memmap(folder / name, kind, "r", begin, shape))
    except OSError as error:
        raise unreadable(folder / name, error) from error
