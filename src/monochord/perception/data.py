"""Features of sounds and of datasets, for programs: arrays, and data sets of torch."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError, did_you_mean
from monochord.core.notebook import html_table, lines
from monochord.core.shapes import sound
from monochord.core.types import Audio, Floats, Indices, Signal
from monochord.core.units import Seconds
from monochord.datasets.audit import Audit
from monochord.datasets.manifest import Manifest
from monochord.datasets.split import SPLIT_FILE, Split
from monochord.datasets.store import Dataset, open_dataset, window_starts
from monochord.perception.features import FEATURES
from monochord.perception.training.rows import Rows
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import Sensor

if TYPE_CHECKING:
    from torch.utils.data import TensorDataset

BATCH = 64
"""Windows of which features are computed at once."""


def features(
    audio: Audio,
    sensor: str | Sensor = "prototype",
    *,
    feature: str = "fft_harmonic",
    sample_rate: int = 44100,
    window: Seconds = 0.1,
    hop: Seconds = 0.01,
    **options: Any,
) -> "FeatureRows":
    """Return the features of every window of a recording.

    Parameters
    ----------
    audio
        Samples (channels, n) in full scale, as float32 or what converts to it.
    sensor
        A preset's name, a TOML file, or a sensor: whose string sounds.
    feature
        Name of the feature; ``monochord list features`` shows them.
    sample_rate
        Frames a second.
    window, hop
        Length of a window and distance of window starts, in s.
    options
        Options of the feature, such as ``tones=True``.

    Returns
    -------
    FeatureRows
        Rows (windows, columns) float32, an array whose `columns` are named; row k is of the window that
        starts at k `hop`.

    Raises
    ------
    InputError
        For audio of another shape or shorter than a window, an unknown sensor or feature, or an option that
        cannot be used.

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
        raise InputError(given, "(channels, samples), 1 or 2 channels", "transpose (samples, channels)")
    size, step = round(window * sample_rate), round(hop * sample_rate)
    if size < 1 or step < 1 or samples.shape[1] < size:
        given = f"{samples.shape[1]} samples for windows of {size} every {step}"
        raise InputError(given, "one whole window or more, every sample or more")
    string = (load_sensor(sensor) if isinstance(sensor, str) else sensor).string
    signal = Signal(sample_rate=sample_rate, channels=samples.shape[0], string=string)
    extractor = FEATURES.build(feature, options).prepare(signal, size)
    starts = window_starts(samples.shape[1], size, step)
    rows = np.empty((len(starts), len(extractor.columns)), np.float32)
    for first in range(0, len(starts), BATCH):
        batch = [samples[:, start : start + size] for start in starts[first : first + BATCH].tolist()]
        rows[first : first + BATCH] = extractor(np.stack(batch))
    return FeatureRows(rows, extractor.columns)


class FeatureRows(np.ndarray[tuple[int, ...], np.dtype[np.float32]]):
    """Features (windows, columns) float32, an array of NumPy whose columns have names.

    Rows, columns and copies of it keep the names; what is computed from it is a plain array.

    Parameters
    ----------
    rows
        The features (windows, columns).
    columns
        The name of each column.

    Attributes
    ----------
    columns : tuple of str
        The name of each column; empty where it is no table of columns any more, such as one row.

    Raises
    ------
    InputError
        If there is not one name for each column.

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
            own = key if isinstance(key, tuple) else (key,)
            if self.columns and part.ndim == 2 and len(own) <= 2:
                names = np.array(self.columns)[own[1] if len(own) == 2 else slice(None)].ravel().tolist()
                part.columns = tuple(names) if len(names) == part.shape[1] else ()
        return part

    @property
    def values(self) -> Audio:
        """The same numbers as a plain array, without a copy."""
        return self.view(np.ndarray)

    def column(self, name: str) -> Audio:
        """Return the values (windows,) of a column; raises `InputError` where there is none of this name."""
        if name not in self.columns:
            raise InputError(f"column '{name}'", "one of rows.columns", did_you_mean(name, self.columns))
        return self.values[:, self.columns.index(name)]


def load_dataset(path: str | Path, split: str | Path | None = None) -> "LabelledData":
    """Return the dataset in a folder that ``monochord build`` made, with its split.

    Parameters
    ----------
    path
        The folder.
    split
        A file that ``monochord build`` wrote; the folder's ``split.json`` by default.

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
        Windows with labels on disk.
    split
        Which windows are for training, for validation and for the test.
    audit
        The leaks and notes of the split, where it was audited, as by `monochord.build`.
    split_file
        The file of the split, where it stands in one.
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
        """What the dataset is made of: sessions, windows, labels, checksums."""
        return self.dataset.manifest

    def refuse_leaks(self) -> None:
        """Raise `InputError`, in one line, if the audit found a leak."""
        if self.audit is not None:
            self.audit.refuse_leaks()

    def __repr__(self) -> str:
        return lines(*self._facts())

    def _repr_html_(self) -> str:
        return html_table(*self._facts())

    def _facts(self) -> tuple[str, list[tuple[str, str]]]:
        title, facts = self.dataset.facts()
        parts = ", ".join(f"{name} {len(rows)}" for name, rows in self.split.parts.items())
        return title, [*facts, ("split", parts)]

    def rows(self, part: str | None = None) -> Indices:
        """Return the numbers (n,) of the usable windows of a part, or of all parts, in order of time."""
        if part is not None and part not in self.split.parts:
            raise InputError(f"part '{part}'", ", ".join(self.split.parts))
        chosen = [rows for name, rows in self.split.parts.items() if part in (None, name)]
        rows = np.sort(np.concatenate(chosen))
        return rows[self.dataset.usable[rows]]

    def labels(self, rows: Indices) -> Mapping[str, Floats]:
        """Return the labels (n,) of windows by name, NaN where they are not known."""
        return {name: self.dataset.label(name)[rows] for name in self.dataset.labels}

    def arrays(
        self,
        feature: str = "fft_harmonic",
        part: str | None = None,
        *,
        sensor: str = "prototype",
        **options: Any,
    ) -> tuple[Audio, Mapping[str, Floats], NDArray[np.str_]]:
        """Return features, labels and parts of the usable windows; features are cached beside the dataset.

        Parameters
        ----------
        feature
            Name of the feature.
        part
            ``"train"``, ``"validation"`` or ``"test"``; all of them by default.
        sensor
            The sensor of the recordings.
        options
            Options of the feature.

        Returns
        -------
        x
            Rows (n, columns) float32.
        y
            Labels (n,) by name: ``contact`` and ``slip`` 0 or 1, ``position`` in m, ``force`` in N ...; NaN
            where a label is not known.
        parts
            The name (n,) of each row's part.
        """
        manifest, rows = self.dataset.manifest, self.rows(part)
        signal = Signal(
            sample_rate=manifest.sample_rate, channels=manifest.channels, string=load_sensor(sensor).string
        )
        table = Rows.prepared(self.dataset, signal, feature, options, self.dataset.path / "features")
        parts = np.full(len(self.dataset), "", dtype="<U10")
        for name, members in self.split.parts.items():
            parts[members] = name
        return table.of(rows), self.labels(rows), parts[rows]

    def torch(self, part: str, feature: str = "fft_harmonic", **options: Any) -> "TensorDataset":
        """Return a part as a data set of torch: features (columns,), then labels (names,) with NaN, in order.

        The labels are in the order of `labels`. Raises `InputError` where torch is not installed.
        """
        from monochord.perception.training._torch import torch_library  # noqa: PLC0415

        torch = torch_library()
        x, y, _ = self.arrays(feature, part, **options)
        labels = np.stack([values.astype(np.float32) for values in y.values()], axis=1)
        return torch.utils.data.TensorDataset(torch.from_numpy(x), torch.from_numpy(labels))
