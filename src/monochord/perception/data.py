"""Features of sounds and datasets for programs, as NumPy arrays or PyTorch datasets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError, did_you_mean
from monochord.core.notebook import html_table, lines
from monochord.core.ranges import Positive, SampleRate, checked
from monochord.core.shapes import sound
from monochord.core.types import Audio, Floats, Indices, Signal
from monochord.core.units import Seconds
from monochord.datasets.audit import Audit
from monochord.datasets.manifest import Manifest
from monochord.datasets.split import SPLIT_FILE, Split
from monochord.datasets.store import Dataset, open_dataset, window_starts
from monochord.perception.features import FEATURES
from monochord.perception.training.rows import DatasetFeature
from monochord.physics.sensors import as_sensor, refuse_other_length
from monochord.physics.twin import Sensor

if TYPE_CHECKING:
    from torch.utils.data import TensorDataset

BATCH = 64
"""Windows whose features are computed in one call."""


@checked
def features(
    audio: Audio,
    sensor: str | Path | Sensor = "prototype",
    *,
    feature: str = "fft_harmonic",
    sample_rate: SampleRate = 44100,
    window: Positive[Seconds] = 0.1,
    hop: Positive[Seconds] = 0.01,
    **options: Any,
) -> "FeatureRows":
    """Return the features of every window of a recording.

    Parameters
    ----------
    audio
        Samples (channels, n), 1 or 2 channels, full scale is 1; float32 or convertible to it.
    sensor
        The sensor that recorded the sound: a preset's name, the path of a TOML file, or a `Sensor`.
    feature
        Name of the feature; ``monochord list features`` shows all.
    sample_rate
        In Hz.
    window, hop
        Length of a window, and time from one window start to the next, in s.
    options
        Options of the feature, such as ``bins=64`` of ``log_mel``.

    Returns
    -------
    FeatureRows
        Features (windows, columns) float32 with named `columns`. Row k describes the window that starts at
        time k `hop`; it is NaN where a sample of that window is no finite number.

    Raises
    ------
    InputError
        If the audio has another shape or is shorter than a window, the sensor or feature is unknown, or the
        feature refuses an option.

    Examples
    --------
    >>> silence = np.zeros((2, 8820), np.float32)
    >>> rows = features(silence, sensor="prototype")
    >>> rows.shape, rows.columns[0]
    ((11, 300), 'mic 1 own 1 level')
    """
    samples = sound(audio)
    if samples.shape[0] > 2:
        given = f"audio of shape {samples.shape}"
        raise InputError(given, "(channels, samples) with 1 or 2 channels", "transpose the array")
    size, step = round(window * sample_rate), round(hop * sample_rate)
    if size < 1 or step < 1 or samples.shape[1] < size:
        given = f"{samples.shape[1]} samples for windows of {size} every {step}"
        raise InputError(given, "audio of at least one window, and a window and hop of at least one sample")
    string = as_sensor(sensor).string
    signal = Signal(sample_rate=sample_rate, channels=samples.shape[0], string=string)
    extractor = FEATURES.build(feature, options).prepare(signal, size)
    starts = window_starts(samples.shape[1], size, step)
    rows = np.empty((len(starts), len(extractor.columns)), np.float32)
    for first in range(0, len(starts), BATCH):
        batch = [samples[:, start : start + size] for start in starts[first : first + BATCH].tolist()]
        stacked = np.stack(batch)
        rows[first : first + BATCH] = extractor(stacked)
        rows[first : first + BATCH][~np.isfinite(stacked).all(axis=(1, 2))] = np.nan
    return FeatureRows(rows, extractor.columns)


class FeatureRows(np.ndarray[tuple[int, ...], np.dtype[np.float32]]):
    """A NumPy array of features (windows, columns) float32 with named columns.

    Slices of rows and columns, and copies, keep the names. The result of arithmetic is a plain array.

    Parameters
    ----------
    rows
        The features (windows, columns).
    columns
        The name of each column.

    Attributes
    ----------
    columns : tuple of str
        The name of each column; empty for a part that is not a table, such as a single row.

    Raises
    ------
    InputError
        If the number of names differs from the number of columns.

    Examples
    --------
    >>> rows = FeatureRows(np.eye(3, dtype=np.float32), ("a", "b", "c"))
    >>> rows[:2, [0, 2]].columns, rows.column("b").tolist(), float(rows.mean())
    (('a', 'c'), [0.0, 1.0, 0.0], 0.3333333432674408)
    """

    columns: tuple[str, ...]

    def __new__(cls, rows: Audio, columns: Sequence[str]) -> Self:
        """Return a view of the rows with these names."""
        if rows.ndim != 2 or rows.shape[1] != len(columns):
            given = f"rows of shape {rows.shape} with {len(columns)} names"
            raise InputError(given, "(windows, columns), one name for each column")
        view = rows.view(cls)
        view.columns = tuple(columns)
        return view

    def __array_finalize__(self, obj: Any) -> None:
        is_alike = isinstance(obj, FeatureRows) and obj.shape == self.shape
        is_alike = is_alike and (self.flags.owndata or self.strides == obj.strides)  # not transposed
        self.columns = obj.columns if is_alike else ()

    def __repr__(self) -> str:
        if not self.columns:
            return repr(self.values)
        columns = ("columns", f"{len(self.columns)}, {', '.join(self.columns)}")
        return lines(f"FeatureRows: {len(self)} windows", [columns])

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:  # noqa: FBT001, FBT002
        plain = array.view(np.ndarray)
        return plain[()] if return_scalar else plain

    def __reduce__(self) -> tuple[Any, ...]:
        if not self.columns:
            return super().__reduce__()  # pyright: ignore[reportReturnType]
        return FeatureRows, (self.values, self.columns)

    def __getitem__(self, key: Any) -> Any:
        part = super().__getitem__(key)
        if isinstance(part, FeatureRows):
            part.columns = ()
            keys = key if isinstance(key, tuple) else (key,)
            if self.columns and part.ndim == 2 and len(keys) <= 2:
                names = np.array(self.columns)[keys[1] if len(keys) == 2 else slice(None)].ravel().tolist()
                part.columns = tuple(names) if len(names) == part.shape[1] else ()
        return part

    @property
    def values(self) -> Audio:
        """The same numbers as a plain array; the memory is shared."""
        return self.view(np.ndarray)

    @checked
    def column(self, name: str) -> Audio:
        """Return the values (windows,) of a column; raises `InputError` for an unknown name."""
        if name not in self.columns:
            raise InputError(f"column '{name}'", "one of rows.columns", did_you_mean(name, self.columns))
        return self.values[:, self.columns.index(name)]


@checked
def load_dataset(path: str | Path, split: str | Path | None = None) -> "LabelledData":
    """Return a dataset that ``monochord build`` made, with its split.

    Parameters
    ----------
    path
        Folder of the dataset.
    split
        A split file that ``monochord build`` wrote; the folder's ``split.json`` by default.

    Raises
    ------
    InputError
        If there is no dataset, or it or its split is damaged.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> folder, twin = mkdtemp(), ["groups=[{name='hold', grid=[2, 1], hold=0.3}]"]
    >>> data = mc.build(mc.collect("quick", folder, settings=twin), f"{folder}/dataset")
    >>> x, y, parts = load_dataset(f"{folder}/dataset").arrays()
    >>> x.shape[1], len(y["position"]) == len(parts) == len(x)
    (300, True)
    """
    dataset = open_dataset(Path(path))
    file = Path(split or dataset.path / SPLIT_FILE)
    return LabelledData(dataset=dataset, split=Split.read(file), split_file=file)


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelledData:
    """A dataset and its split, as arrays.

    Attributes
    ----------
    dataset
        Labelled windows on disk.
    split
        The windows of the parts train, validation and test.
    audit
        Leaks and notes that the audit of the split found, as `monochord.build` runs it; None without an
        audit.
    split_file
        The file that the split was read from; None for a split in memory.
    """

    dataset: Dataset
    split: Split
    audit: Audit | None = None
    split_file: Path | None = None

    def __len__(self) -> int:
        return len(self.dataset)

    @property
    def path(self) -> Path:
        """The dataset's folder."""
        return self.dataset.path

    @property
    def manifest(self) -> Manifest:
        """The dataset's contents: sessions, windows, labels, checksums."""
        return self.dataset.manifest

    def refuse_leaks(self) -> None:
        """Raise a one-line `InputError` if the audit found a leak."""
        if self.audit is not None:
            self.audit.refuse_leaks()

    def __repr__(self) -> str:
        return lines(*self._facts())

    def _repr_html_(self) -> str:
        return html_table(*self._facts())

    def _facts(self) -> tuple[str, list[tuple[str, str]]]:
        title, facts = self.dataset.facts()
        parts = ", ".join(f"{name} {len(rows)}" for name, rows in self.split.parts.items())
        return title, [*facts[:2], ("split", parts), *facts[2:]]

    @checked
    def rows(self, part: str | None = None) -> Indices:
        """Return the indices (n,) of a part's usable windows in time order; None means all parts."""
        if part is not None and part not in self.split.parts:
            raise InputError(f"part '{part}'", ", ".join(self.split.parts))
        chosen = [rows for name, rows in self.split.parts.items() if part in (None, name)]
        rows = np.sort(np.concatenate(chosen))
        return rows[self.dataset.usable[rows]]

    @checked
    def labels(self, rows: Indices) -> Mapping[str, Floats]:
        """Return the labels (n,) of windows by name; NaN marks a missing label."""
        if rows.size and not 0 <= rows.min() <= rows.max() < len(self):
            raise InputError(f"rows {rows.min()} to {rows.max()}", f"0 to {len(self) - 1}")
        return {name: self.dataset.label(name)[rows] for name in self.dataset.labels}

    @checked
    def arrays(
        self,
        feature: str = "fft_harmonic",
        part: str | None = None,
        *,
        sensor: str | Path | Sensor = "prototype",
        **options: Any,
    ) -> tuple[Audio, Mapping[str, Floats], NDArray[np.str_]]:
        """Return features, labels and parts of the usable windows; caches features in the dataset's folder.

        Parameters
        ----------
        feature
            Name of the feature.
        part
            ``"train"``, ``"validation"`` or ``"test"``; all three by default.
        sensor
            The sensor that made the recordings.
        options
            Options of the feature.

        Returns
        -------
        x
            Features (n, columns) float32.
        y
            Labels (n,) by name, such as ``contact`` and ``slip`` (0 or 1), ``position`` in m and ``force`` in
            N. NaN marks a missing label.
        parts
            The name (n,) of each window's part.

        Raises
        ------
        InputError
            For an unknown feature, option or part, or sessions of a string of another length than the
            sensor's.
        """
        manifest, rows, string = self.dataset.manifest, self.rows(part), as_sensor(sensor).string
        for length in {part.length or string.length for part in manifest.parts}:
            refuse_other_length(length, string.length, "sessions of a string", "name their sensor")
        signal = Signal(sample_rate=manifest.sample_rate, channels=manifest.channels, string=string)
        table = DatasetFeature.prepared(
            self.dataset, signal, feature, options, self.dataset.path / "features"
        )
        parts = np.full(len(self.dataset), "", dtype="<U10")
        for name, members in self.split.parts.items():
            parts[members] = name
        return table.of(rows), self.labels(rows), parts[rows]

    @checked
    def torch(self, part: str, feature: str = "fft_harmonic", **options: Any) -> "TensorDataset":
        """Return a part as a PyTorch dataset of (features, labels) pairs.

        Features have the shape (columns,). Labels have the shape (names,), in the order of `labels`, with NaN
        for a missing one. Raises `InputError` if PyTorch is not installed.
        """
        from monochord.perception.training._torch import torch_library  # noqa: PLC0415

        torch = torch_library()
        x, y, _ = self.arrays(feature, part, **options)
        labels = np.stack([values.astype(np.float32) for values in y.values()], axis=1)
        return torch.utils.data.TensorDataset(torch.from_numpy(x), torch.from_numpy(labels))
