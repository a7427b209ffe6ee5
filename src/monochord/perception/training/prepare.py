"""From settings and a dataset to what the loop needs: definition, features, examples, scaling."""

import dataclasses
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal
from monochord.datasets.manifest import FILE, checksum
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset, Indices
from monochord.perception.features import FEATURES
from monochord.perception.features.base import SupportsCompliance
from monochord.perception.heads.base import CONTACT, Task
from monochord.perception.model.definition import Definition, FeatureRecord, HeadRecord
from monochord.perception.model.probe import probed
from monochord.perception.training.examples import Examples, assembled, believed, chosen, folded
from monochord.perception.training.rows import Noise, Rows, Told
from monochord.perception.training.settings import Settings
from monochord.physics.sensors import load_sensor

FLAT = 1e-6
"""Columns that vary by less are left as they are, less their mean."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """A dataset with the features that are read off it, and the model that is to come of them."""

    dataset: Dataset
    definition: Definition
    feature: Rows
    reference: Rows | None

    @property
    def tasks(self) -> dict[str, Task]:
        """The task of each head."""
        return {name: record.task for name, record in self.definition.heads.items()}


def read_split(settings: Settings, dataset: Dataset) -> Split:
    """Return the split that the settings name; raises `InputError` if it is not one of this dataset."""
    file = settings.split or dataset.path / "split.json"
    split = Split.read(file)
    if split.dataset and split.dataset != checksum(dataset.path / FILE):
        raise InputError(f"split {file} of another dataset", f"one of {dataset.path}", "split that one again")
    if any(rows.size and rows.max() >= len(dataset) for rows in split.parts.values()):
        raise InputError(f"split {file} of more windows", f"{len(dataset)}, as there are", "split it again")
    return split


def material(settings: Settings, dataset: Dataset, split: Split) -> Material:
    """Return what is to be trained, with every head still in a scale of 1.

    Raises
    ------
    InputError
        For an unknown feature, head or sensor, or options that they refuse.
    """
    told, string = dataset.manifest, load_sensor(settings.sensor).string
    signal = Signal(sample_rate=told.sample_rate, channels=told.channels, string=string)
    folder = settings.cache or dataset.path / "features"

    def rows_of(name: str, options: dict[str, Any]) -> tuple[Rows, FeatureRecord]:
        extractor = FEATURES.build(name, options).prepare(signal, told.window)
        rows = Rows(dataset=dataset, name=name, options=options, extractor=extractor, folder=folder)
        return rows, FeatureRecord(name=name, options=options, columns=extractor.columns)

    feature, record = rows_of(*settings.feature_named())
    rule = settings.context.rule() if settings.context.on else None
    reference = None
    if rule is not None:
        reference, kept = rows_of(rule.feature.name, rule.feature.options)
        rule = dataclasses.replace(rule, feature=kept)
    used = np.unique(dataset.session[np.concatenate([split.train, split.validation])]).tolist()
    definition = Definition(
        title=settings.title,
        sample_rate=told.sample_rate,
        channels=told.channels,
        window=told.window,
        hop=told.hop,
        feature=record,
        reference=rule,
        heads={name: HeadRecord(task=task) for name, task in settings.tasks().items()},
        string=string,
        simulated=any(told.parts[number].simulated for number in used),
        dataset=checksum(dataset.path / FILE),
        sessions={told.parts[number].name: told.parts[number].checksum for number in used},
        versions={name: version(name) for name in ("monochord", "numpy", "torch")},
    )
    return Material(dataset=dataset, definition=definition, feature=feature, reference=reference)


def stream_of(dataset: Dataset, part: Indices) -> Indices:
    """Return the windows (n,) of a part that can be heard, in the order of their sessions and of time."""
    return np.sort(part[dataset.usable[part]])


def examples_of(
    source: Material, part: Indices, name: str, noises: tuple[Noise, ...] = (), told: Told = lambda *_: None
) -> Examples:
    """Return the examples of a part called `name`: its clean windows, then a copy for each of `noises`.

    The reference beside a noisy window is one that was heard in the same kind of noise.
    """
    dataset, rule = source.dataset, source.definition.reference
    rows, stream = chosen(dataset, part, source.tasks, name), stream_of(dataset, part)
    contact = believed(dataset, stream)
    quiet = stream[contact == 0.0]
    base: list[Audio] = []
    context: list[Audio] = []
    for noise in (None, *noises):
        base.append(source.feature.of(rows, noise, told))
        if rule is None or source.reference is None:
            context.append(np.zeros((len(rows), 0), np.float32))
            continue
        kept = dict(zip(quiet.tolist(), source.reference.of(quiet, noise, told), strict=True))
        whole = folded(dataset, stream, contact, rule, kept)
        context.append(whole[np.searchsorted(stream, rows)])
    return assembled(dataset, rows, source.tasks, base, context)


def with_objects(source: Material, examples: Examples, settings: Settings) -> Examples:
    """Return examples with copies, after all others, as objects would have given them that were never heard.

    Raises
    ------
    InputError
        If the feature does not support this augmentation, or the dataset has no label of force.
    """
    dataset, options = source.dataset, settings.objects
    if not options.copies:
        return examples
    label, valid = dataset.label("force")[examples.rows], dataset.valid["force"][examples.rows]
    force = np.where(valid & (dataset.label(CONTACT)[examples.rows] == 1.0), label, 0.0)
    random = np.random.default_rng(settings.seed)
    extractor = source.feature.extractor
    if not isinstance(extractor, SupportsCompliance):
        name = type(extractor).__module__.rpartition(".")[2]
        given = f"feature '{name}' with copies of other contact compliance"
        raise InputError(given, "fft_harmonic with tones", "set objects.copies = 0")
    base, context = [examples.base], [examples.context]
    for _ in range(options.copies):
        give = np.exp(random.uniform(*np.log(options.give), size=(len(examples.base), len(force))))
        made = [
            extractor.with_compliance(row, force, share)
            for row, share in zip(examples.base, give, strict=True)
        ]
        base.append(np.stack(made))
        context.append(examples.context)
    return dataclasses.replace(examples, base=np.concatenate(base), context=np.concatenate(context))


def scaling(train: Examples) -> dict[str, Audio]:
    """Return mean and standard deviation of each column, as the arrays of a model.

    Those of the reference are of windows that have one, and its mark stays as it is.
    """
    mean, scale = _mean_and_scale(train.base.reshape(-1, train.base.shape[-1]))
    found = {"scaler.mean": mean, "scaler.scale": scale}
    if train.context.shape[-1]:
        context = train.context.reshape(-1, train.context.shape[-1])
        context = context[context[:, -1] > 0.0]
        mean, scale = _mean_and_scale(context) if len(context) else (np.zeros(1), np.ones(1))
        whole = np.zeros(train.context.shape[-1], np.float32)
        whole_mean, whole_scale = whole + mean.astype(np.float32), whole + scale.astype(np.float32)
        whole_mean[-1], whole_scale[-1] = 0.0, 1.0
        found |= {"context.mean": whole_mean, "context.scale": whole_scale}
    return found


def scaled_heads(definition: Definition, train: Examples) -> Definition:
    """Return the definition with each amount in the scale of its training labels: mean 0, deviation 1."""
    heads: dict[str, HeadRecord] = {}
    for name, record in definition.heads.items():
        labels: Floats = train.labels[name][train.masks[name]]
        if record.task.is_chance:
            heads[name] = record
            continue
        scale = float(labels.std()) or 1.0
        heads[name] = dataclasses.replace(record, offset=float(labels.mean()), scale=scale)
    return dataclasses.replace(definition, heads=heads)


def _mean_and_scale(rows: Audio) -> tuple[Audio, Audio]:
    mean = rows.mean(axis=0, dtype=np.float64)
    deviation = rows.std(axis=0, dtype=np.float64)
    return mean.astype(np.float32), np.where(deviation > FLAT, deviation, 1.0).astype(np.float32)


def probes(source: Material) -> dict[str, Audio]:
    """Return what the features answer to made-up windows, as the arrays of a model."""
    told = source.definition
    found = {"scaler.probe": probed(source.feature.extractor, told.channels, told.window)}
    if source.reference is not None:
        found["context.probe"] = probed(source.reference.extractor, told.channels, told.window)
    return found


def quietest(dataset: Dataset, rows: Indices) -> float:
    """Return half the root mean square that all but a thousandth of the windows (n,) reach."""
    levels = [
        float(np.sqrt(np.mean(np.square(dataset.window(row), dtype=np.float64)))) for row in rows.tolist()
    ]
    return 0.5 * float(np.quantile(levels, 0.001))


def noises_of(settings: Settings, sample_rate: int) -> tuple[Noise, ...]:
    """Return the noise of each copy that the settings ask for."""
    if not settings.noise.copies:
        return ()
    augmentation = settings.noise.augmentation(settings.seed, sample_rate)
    return tuple(Noise(augmentation=augmentation, copy=copy) for copy in range(1, settings.noise.copies + 1))
