"""The inputs of the training loop from settings and a dataset: definition, examples and scaling."""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Flags, Floats, Indices, Progress, Signal
from monochord.core.units import Metres
from monochord.datasets.augment import RECORDED
from monochord.datasets.split import SPLIT_FILE, Split
from monochord.datasets.store import Dataset
from monochord.perception.heads.base import CONTACT, POSITION, REFINED_SCALE, Task
from monochord.perception.model.definition import Definition, FeatureRecord, HeadRecord
from monochord.perception.model.network import Scaling, network_inputs
from monochord.perception.model.probe import probed
from monochord.perception.training.rows import AddedNoise, DatasetFeature
from monochord.perception.training.scratch import empty, release
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.tuning.sessions import force_scales, length_scales
from monochord.physics.sensors import load_sensor

BLOCK = 2048
"""Number of windows, with all their copies, that are in memory at a time."""
MIN_DEVIATION = 1e-6
"""Columns with a smaller standard deviation are not scaled."""
TOUCH_SPACING: Metres = 2e-3
"""Distance from the outermost touches of the training up to which a position counts as trained."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingData:
    """A dataset, its features, and the definition of the model to train.

    `scratch` is the folder of the files in which examples are kept, block by block; None: in memory.
    """

    dataset: Dataset
    definition: Definition
    feature: DatasetFeature
    scratch: Path | None = None

    @property
    def tasks(self) -> dict[str, Task]:
        """The task of each head."""
        return {name: record.task for name, record in self.definition.heads.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Examples:
    """Windows of one part of a split: a clean copy, then augmented copies.

    `rows` (n,) are the windows' rows in the dataset. `session` (n,) and `touch` (n,) are the numbers of their
    sessions and touches. `base` (copies, n, d) is the unscaled feature. `labels` (n,) holds each head's
    label, 0 where invalid. `masks` (n,) says which windows count for each head.
    """

    rows: Indices
    session: Indices
    touch: Indices
    base: Audio
    labels: Mapping[str, Floats]
    masks: Mapping[str, Flags]

    def blocks(self) -> Iterator[tuple[slice, "Examples"]]:
        """Yield `BLOCK` windows at a time, with their place; the memory of features in files is let go."""
        for first in range(0, len(self.rows), BLOCK):
            at = slice(first, first + BLOCK)
            yield at, self._of(at, self.base[:, at])
            release(self.base)

    def at(self, copies: Indices, numbers: Indices) -> "Examples":
        """Return some windows (n,), each in one of its copies."""
        some = self._of(numbers, self.base[copies, numbers][np.newaxis])
        release(self.base)
        return some

    def _of(self, at: slice | Indices, base: Audio) -> "Examples":
        return Examples(
            rows=self.rows[at],
            session=self.session[at],
            touch=self.touch[at],
            base=base,
            labels={name: values[at] for name, values in self.labels.items()},
            masks={name: mask[at] for name, mask in self.masks.items()},
        )


def read_split(settings: TrainingSettings, dataset: Dataset) -> Split:
    """Return the split that the settings name; raises `InputError` if it belongs to another dataset."""
    file = settings.split or dataset.path / SPLIT_FILE
    split = Split.read(file)
    if split.dataset and split.dataset != dataset.checksum:
        raise InputError(f"split {file} of another dataset", f"a split of {dataset.path}", "split it again")
    if any(rows.size and rows.max() >= len(dataset) for rows in split.parts.values()):
        raise InputError(
            f"split {file} with windows that the dataset lacks", f"{len(dataset)} windows", "split it again"
        )
    return split


def training_data(
    settings: TrainingSettings,
    dataset: Dataset,
    split: Split,
    *,
    workers: int | None = None,
    cluster: str = "",
) -> TrainingData:
    """Return the features and the definition of a model to train; heads have the scale 1.

    `workers` and `cluster` compute the features; see `rows.DatasetFeature`. Raises `InputError` if a feature,
    head or sensor is unknown, or refuses an option.
    """
    manifest, sensor = dataset.manifest, load_sensor(settings.sensor)
    string = sensor.string
    signal = Signal(sample_rate=manifest.sample_rate, channels=manifest.channels, string=string)
    folder = settings.cache or dataset.path / "features"

    name, options = settings.feature_named()
    feature = DatasetFeature.prepared(
        dataset, signal, name, options, folder, workers=workers, cluster=cluster
    )
    record = FeatureRecord(name=name, options=options, columns=feature.extractor.columns)
    used = np.unique(dataset.session[np.concatenate([split.train, split.validation])]).tolist()
    definition = Definition(
        title=settings.title,
        sample_rate=manifest.sample_rate,
        channels=manifest.channels,
        window=manifest.window,
        hop=manifest.hop,
        feature=record,
        heads={name: HeadRecord(task=task) for name, task in settings.tasks().items()},
        string=string,
        sensing_range=_sensing_range(sensor.range, dataset, split),
        length_std=settings.length_std,
        simulated=any(manifest.parts[number].simulated for number in used),
        dataset=dataset.checksum,
        sessions={manifest.parts[number].name: manifest.parts[number].checksum for number in used},
        versions=_versions(),
    )
    return TrainingData(dataset=dataset, definition=definition, feature=feature)


def _versions() -> dict[str, str]:
    """Return the versions of the libraries that learn, as far as they are installed."""
    found = dict[str, str]()
    for name in ("monochord", "numpy", "scikit-learn", "torch"):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _sensing_range(
    design: tuple[Metres, Metres], dataset: Dataset, split: Split
) -> tuple[Metres, Metres] | None:
    """Return the range of positions that a model can estimate: the overlap of the design and the training.

    None if no training touch in the design's range has a position.
    """
    if POSITION not in dataset.labels:
        return None
    place = dataset.label(POSITION)[split.train][dataset.valid[POSITION][split.train]]
    if not place.size:
        return None
    low = max(design[0], float(place.min()) - TOUCH_SPACING)
    high = min(design[1], float(place.max()) + TOUCH_SPACING)
    return (low, high) if low < high else None


def masks_of(dataset: Dataset, tasks: Mapping[str, Task]) -> dict[str, Flags]:
    """Return the windows (n,) of a dataset that count for each head.

    A window counts if it is complete, its label is valid and, for a head that requires a touch, contact is 1.
    Raises `InputError` if a label is missing, or is marked valid and not finite.
    """
    masks: dict[str, Flags] = {}
    touched = dataset.label(CONTACT) == 1.0
    for name, task in tasks.items():
        values, valid = dataset.label(task.label), dataset.valid[task.label]
        if not np.isfinite(values[valid]).all():
            count = int((~np.isfinite(values[valid])).sum())
            given = f"label '{task.label}', marked valid but not finite in {count} windows"
            raise InputError(given, "finite numbers", "build the dataset again")
        masks[name] = dataset.usable & valid & (touched | (not task.touched))
    return masks


def chosen(dataset: Dataset, rows: Indices, tasks: Mapping[str, Task], part: str) -> Indices:
    """Return the windows of a part that count for any head, in order of session and time.

    Raises `InputError` if no window counts for a head, or all labels of a probability are equal.
    """
    masks = masks_of(dataset, tasks)
    if not rows.size:
        raise InputError(f"a split with no windows to {part}", "one window or more", "change the split")
    for name, task in tasks.items():
        values = dataset.label(task.label)[rows[masks[name][rows]]]
        if not values.size or (task.is_probability and values.min() == values.max()):
            kind = "windows of both classes" if task.is_probability else "windows"
            given = f"part '{part}' without {kind} for the head '{name}'"
            allowed = "windows with 0 and with 1" if task.is_probability else "one window or more"
            others = ", ".join(f"{other}={{}}" for other in tasks if other != name)
            raise InputError(given, allowed, f"collect more, or leave the head out: 'heads={{{others}}}'")
    counts: Flags = np.logical_or.reduce(list(masks.values()))
    return np.sort(rows[counts[rows]])


def stream_of(dataset: Dataset, part: Indices) -> Indices:
    """Return the usable windows (n,) of a part, in order of session and time."""
    return np.sort(part[dataset.usable[part]])


def labelled_contact(dataset: Dataset, rows: Indices) -> Floats:
    """Return the label contact (n,); 1 if it is missing."""
    contact = dataset.label(CONTACT)[rows]
    return np.where(np.isfinite(contact), contact, 1.0)


def touches_of(dataset: Dataset) -> Indices:
    """Return the number (n,) of each window's touch; an untouched window has the number of the last touch.

    A touch is a run of windows of one session with contact other than 0.
    """
    on = labelled_contact(dataset, np.arange(len(dataset))) > 0.0
    first = np.diff(dataset.session, prepend=-1) != 0
    begins = on & (first | ~np.concatenate([[False], on[:-1]]))
    return np.cumsum(begins | (first & ~on)).astype(np.int64)


def assembled(
    dataset: Dataset,
    rows: Indices,
    tasks: Mapping[str, Task],
    base: Audio,
    scales: Mapping[str, Floats] | None = None,
) -> Examples:
    """Return the examples of windows `rows` (n,) from features (copies, n, d).

    Labels in the units of `scales` are divided by these (windows of the dataset,), which convert positions
    (m) and forces (N) to the design's string.
    """
    masks = masks_of(dataset, tasks)

    def label(task: Task) -> Floats:
        values = dataset.label(task.label)
        return values if scales is None or task.unit not in scales else values / scales[task.unit]

    return Examples(
        rows=rows,
        session=dataset.session[rows].astype(np.int64),
        touch=touches_of(dataset)[rows],
        base=base,
        labels={name: np.where(masks[name][rows], label(task)[rows], 0.0) for name, task in tasks.items()},
        masks={name: masks[name][rows] for name in tasks},
    )


def examples_of(
    data: TrainingData,
    part: Indices,
    name: str,
    noises: tuple[AddedNoise, ...] = (),
    progress: Progress = lambda *_: None,
) -> Examples:
    """Return the examples of the part `name`: clean windows, then a copy for each of `noises`."""
    dataset = data.dataset
    rows = chosen(dataset, part, data.tasks, name)
    base = empty(data.scratch, (1 + len(noises), len(rows), len(data.definition.feature.columns)))
    for copy, noise in enumerate((None, *noises)):
        data.feature.of(rows, noise, progress, out=base[copy])
    design = data.definition.string
    scales = {"N": force_scales(dataset, design), "m": length_scales(dataset, design)} if design else None
    return assembled(dataset, rows, data.tasks, base, scales)


def inputs_of(definition: Definition, scaler: Mapping[str, Audio], examples: Examples) -> Audio:
    """Return the scaled inputs (copies, n, inputs) of all heads; see `network_inputs`."""
    scaling = Scaling.of(scaler)
    return np.stack([network_inputs(base, scaling, definition.clip) for base in np.asarray(examples.base)])


def targets_of(definition: Definition, name: str, examples: Examples) -> Floats:
    """Return what a head's first output should be (copies, n): 0 or 1, or the quantity in its scale."""
    record = definition.heads[name]
    refined, string = definition.refined(name), definition.string
    target = np.empty(examples.base.shape[:2])
    for at, block in examples.blocks():
        target[:, at] = block.labels[name] - record.offset
        if refined is not None and string is not None:
            target[:, at] -= block.base[..., refined].astype(np.float64) * string.length
    return target / record.scale


def scaling(train: Examples) -> dict[str, Audio]:
    """Return mean and standard deviation of each column, as the arrays of a model."""
    mean, scale = mean_and_scale(_flat(block.base) for _, block in train.blocks())
    return {"scaler.mean": mean, "scaler.scale": scale}


def _flat(copies: Audio) -> Audio:
    return copies.reshape(-1, copies.shape[-1])


def scaled_heads(definition: Definition, train: Examples) -> Definition:
    """Return the definition with each quantity scaled to mean 0 and standard deviation 1 in training."""
    heads: dict[str, HeadRecord] = {}
    for name, record in definition.heads.items():
        labels: Floats = train.labels[name][train.masks[name]]
        if record.task.is_probability:
            heads[name] = record
            continue
        if record.task.refines:
            heads[name] = dataclasses.replace(record, scale=REFINED_SCALE)
            continue
        scale = float(labels.std()) or 1.0
        heads[name] = dataclasses.replace(record, offset=float(labels.mean()), scale=scale)
    return dataclasses.replace(definition, heads=heads)


def mean_and_scale(blocks: Iterable[Audio]) -> tuple[Audio, Audio]:
    """Return mean and standard deviation of each column of blocks of rows (n, d); 1 for a constant column.

    Blocks are merged as in Chan, Golub and LeVeque, Updating formulae and a pairwise algorithm for computing
    sample variances (1979). Without a row the mean is 0.

    >>> mean_and_scale([np.array([[1.0, 2.0]], np.float32), np.array([[3.0, 2.0]], np.float32)])
    (array([2., 2.], dtype=float32), array([1., 1.], dtype=float32))
    """
    count, mean, squares = 0, np.zeros(0), np.zeros(0)
    for rows in blocks:
        if not count:
            mean, squares = np.zeros(rows.shape[1]), np.zeros(rows.shape[1])
        if len(rows):
            block_mean, share = rows.mean(axis=0, dtype=np.float64), len(rows) / (count + len(rows))
            squares += len(rows) * rows.var(axis=0, dtype=np.float64)
            squares += count * share * (block_mean - mean) ** 2
            mean = mean + share * (block_mean - mean)
            count += len(rows)
    deviation = np.sqrt(squares / max(count, 1))
    return mean.astype(np.float32), np.where(deviation > MIN_DEVIATION, deviation, 1.0).astype(np.float32)


def probes(data: TrainingData) -> dict[str, Audio]:
    """Return the features of the probe windows, as the arrays of a model."""
    definition = data.definition
    values = probed(data.feature.extractor, definition.channels, definition.window)
    return {"scaler.probe": values}


def quietest(dataset: Dataset, rows: Indices) -> float:
    """Return half of the 0.1 % quantile of the windows' root mean squares, in full scale."""
    squares = (np.mean(np.square(dataset.window(row), dtype=np.float64)) for row in map(int, rows))
    levels = np.sqrt(np.fromiter(squares, np.float64, len(rows)))
    return 0.5 * float(np.quantile(levels, 0.001))


def noises_of(settings: TrainingSettings, sample_rate: int) -> tuple[AddedNoise, ...]:
    """Return the noise of each augmented copy in the settings."""
    if not settings.noise.copies:
        return ()
    first = AddedNoise(augmentation=settings.noise, copy=1, seed=settings.seed, sample_rate=sample_rate)
    return tuple(dataclasses.replace(first, copy=copy) for copy in range(1, settings.noise.copies + 1))


def each_noise(settings: TrainingSettings, sample_rate: int) -> dict[str, AddedNoise]:
    """Return a noise of each kind alone, by kind; a mixture hides the kind in which a method fails."""
    if not settings.noise.copies:
        return {}
    first, *_ = noises_of(settings, sample_rate)
    alone = {
        kind: dataclasses.replace(settings.noise, kinds=(kind,), recordings=())
        for kind in settings.noise.kinds
    }
    if settings.noise.recordings:
        alone[RECORDED] = dataclasses.replace(settings.noise, kinds=())
    return {kind: dataclasses.replace(first, augmentation=each) for kind, each in alone.items()}
