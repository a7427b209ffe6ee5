"""The settings of a training run."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from monochord.core.config import Tree, from_tree, to_tree
from monochord.core.errors import InputError, did_you_mean
from monochord.core.ranges import (
    Checked,
    Count,
    InnerShare,
    Pair,
    PartialShare,
    Positive,
    Share,
    refuse_unordered,
)
from monochord.core.registry import Registry
from monochord.core.units import Seconds
from monochord.datasets.augment import Augmentation
from monochord.datasets.faults import FAULTS
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Feature
from monochord.perception.heads import HEADS
from monochord.perception.heads.base import Head, Task
from monochord.perception.model.definition import FeatureRecord, Kept, Pause, Reference

DEFAULT_HEADS = ("contact", "slip", "position", "force")


@dataclass(frozen=True, slots=True, kw_only=True)
class ContextSettings(Checked):
    """The untouched reference: whether heads have it as an input, its feature, and how it is updated.

    The times and numbers are those of `model.definition.Reference`. `drop` is the share of
    training windows that are shown without it, as at the start of a stream.
    """

    on: bool = True
    feature: dict[str, Any] = field(default_factory=lambda: {"name": "untouched"})
    below: InnerShare = 0.1
    keep: Kept = 8
    every: Pause = 0.1
    settle: Pause = 0.2
    guard: Pause = 0.1
    drop: Share = 0.05

    def rule(self) -> Reference:
        """Return how the reference is updated, for a feature whose columns are not known yet."""
        name, options = named(FEATURES, self.feature)
        record = FeatureRecord(name=name, options=options, columns=())
        return Reference(
            feature=record,
            below=self.below,
            keep=self.keep,
            every=self.every,
            settle=self.settle,
            guard=self.guard,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectSettings(Checked):
    """Contact-compliance augmentation: `copies` of each training window, noisy ones too; 0 adds none.

    Each is the window's row for an object of another compliance, between the two multiples `compliance` of
    the real one's, log-uniform. The feature must support it: `fft_harmonic` with `tones` does.
    """

    copies: Annotated[int, Meta(ge=0, le=100)] = 0
    compliance: Pair[Positive[float]] = (0.05, 4.0)

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        refuse_unordered("objects", compliance=self.compliance)


@dataclass(frozen=True, slots=True, kw_only=True)
class AnomalySettings(Checked):
    """The detector of sound unlike that of the training, see `monochord.perception.training.anomaly`.

    Parameters
    ----------
    on
        Whether a model has one.
    dataset
        Folder of a dataset of sessions that a model should not know, such as one of the plan
        `studies/plans/odd.toml`. Without it the detector learns faults of microphones alone.
    reasons
        Reason to abstain from each of its sessions, by a pattern of their names; sessions of no pattern are
        left out. In those of a pattern in `touches` only touched windows are unlike the training.
    touches
        Patterns of sessions that are as any other until something touches.
    brief
        Those of them that are as any other again when the touch has ended.
    faults
        Reason to abstain for each of `monochord.datasets.faults.FAULTS` that is made of training windows.
    contact_holds
        Reasons beside which contact is estimated all the same, as its head is right there: not those of a
        dead microphone, hum or clipping. Beside reasons of patterns in `brief` it is where it says "touched".
    spared
        Patterns of the names of training sessions that no fault is made of: those of other designs, which
        with their microphones exchanged are one more such design, and no fault.
    memory, touch_memory
        Times in s over which what windows say is averaged, of a fault, which lasts, and of what is brief; 0
        for each window by itself.
    share
        Share of the windows of validation that may be taken for unlike.
    columns
        Names of the feature's columns that it sees, with * for any letters; all if empty.
    hidden
        Units of the hidden layers.
    drop
        Share of the hidden units that are left out at each step of the training.
    rate, decay, batch, epochs
        AdamW, its rate falling to zero by half a cosine.
    """

    on: bool = False
    dataset: Path | None = None
    reasons: dict[str, str] = field(
        default_factory=lambda: {
            "two_touches_*": "two things seem to touch",
            "foam_*": "something very soft seems to touch",
            "driver_*_dead_*": "one driver seems silent",
        }
    )
    touches: tuple[str, ...] = ("two_touches_*", "foam_*", "driver_*_dead_*")
    brief: tuple[str, ...] = ("two_touches_*", "foam_*")
    faults: dict[str, str] = field(
        default_factory=lambda: {
            "microphone 1 dead": "microphone 1 is silent",
            "microphone 2 dead": "microphone 2 is silent",
            "microphones swapped": "the microphones seem swapped",
            "clipping": "mostly clipped",
            "hum": "hum louder than the string",
            "second string": "two strings sound at once",
        }
    )
    contact_holds: tuple[str, ...] = ("one driver seems silent", "the microphones seem swapped")
    spared: tuple[str, ...] = ()
    memory: Seconds = 2.0
    touch_memory: Seconds = 0.2
    share: Annotated[float, Meta(gt=0.0, lt=0.5)] = 0.01
    columns: tuple[str, ...] = ()
    hidden: tuple[int, ...] = (64,)
    rate: InnerShare = 2e-3
    decay: PartialShare = 1e-2
    drop: PartialShare = 0.3
    batch: Count = 256
    epochs: Count = 20

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.on and not (self.faults or (self.dataset and self.reasons)):
            raise InputError("known without kinds", "a fault, or a dataset with reasons", "name one")
        for kind in self.faults:
            if kind not in FAULTS:
                raise InputError(f"known.faults '{kind}'", ", ".join(FAULTS), did_you_mean(kind, FAULTS))


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimiserSettings(Checked):
    """The optimiser: AdamW, its rate falling to zero by half a cosine over all epochs.

    `rate` is its first rate, `decay` the weight decay of heads with hidden layers (their biases and linear
    heads have none), `batch` the windows a step. Training ends after `epochs`, or when no head has become
    better on validation for `patience` of them. Each head keeps the weights of its own best epoch. `threads`
    are torch's; the result depends slightly on their number.
    """

    rate: InnerShare = 1e-3
    decay: Annotated[float, Meta(ge=0.0)] = 1e-3
    batch: Count = 512
    epochs: Count = 60
    patience: Count = 20
    threads: Count = 1

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.decay >= 1.0 / self.rate:
            given = f"optimiser.rate {self.rate:g} with decay {self.decay:g}"
            raise InputError(given, "a product below 1")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSettings:
    """A training run as configured.

    Parameters
    ----------
    title
        What it is, in a few words.
    dataset
        Folder of the dataset.
    split
        File of the split; by default the one in the dataset's folder.
    sensor
        Name of the sensor's design, whose string the features use.
    seed
        Random seed.
    feature
        Name and options of the feature.
    context
        The untouched reference.
    heads
        Options by name of each head that is trained.
    noise
        Noisy copies of training windows.
    objects
        Contact-compliance augmentation of training windows.
    known
        The detector of sound unlike that of the training.
    corrections
        Variables of each head's correction on an unknown build and object, by the head's name: columns of the
        feature or the reference, or the difference of two; see `monochord.perception.model.correction`.
    optimiser
        AdamW and when it ends.
    cache
        Folder for cached features; by default ``features`` in the dataset's folder.
    board
        Also write TensorBoard events into ``board`` in the run's folder. Nothing that is learned depends on
        it, so it is no part of `resolved`, and a run that has begun may go on with it.
    """

    title: str = ""
    dataset: Path = Path("dataset")
    split: Path | None = None
    sensor: str = "prototype"
    seed: int = 0
    feature: dict[str, Any] = field(default_factory=lambda: {"name": "fft_harmonic"})
    context: ContextSettings = ContextSettings()
    heads: dict[str, dict[str, Any]] = field(
        default_factory=lambda: dict[str, dict[str, Any]]((name, {}) for name in DEFAULT_HEADS)
    )
    noise: Augmentation = field(default_factory=Augmentation)
    objects: ObjectSettings = ObjectSettings()
    known: AnomalySettings = AnomalySettings()
    corrections: dict[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    optimiser: OptimiserSettings = OptimiserSettings()
    cache: Path | None = None
    board: bool = False

    @classmethod
    def read(cls, tree: Mapping[str, Any]) -> "TrainingSettings":
        """Build from plain values, strictly; relative paths are those of the caller."""
        settings = from_tree(cls, tree)
        if settings.seed < 0:
            raise InputError(f"seed {settings.seed}", "0 or more")
        return settings

    def tasks(self) -> dict[str, Task]:
        """Return the task of each head; raises `InputError` for an unknown name or option."""
        built: dict[str, Head] = {
            name.replace("-", "_"): HEADS.build(name, options) for name, options in self.heads.items()
        }
        tasks = {name: head.task() for name, head in built.items()}
        for name in self.corrections:
            if name not in tasks or tasks[name].is_probability:
                allowed = ", ".join(head for head, task in tasks.items() if not task.is_probability)
                raise InputError(f"corrections of '{name}'", f"a head that estimates a quantity: {allowed}")
        return tasks

    def feature_named(self) -> tuple[str, dict[str, Any]]:
        """Return the name of the feature, and all its options."""
        return named(FEATURES, self.feature)

    def resolved(self) -> Tree:
        """Return every setting of a run, defaults too, and paths in full: what is saved with it."""
        name, options = self.feature_named()
        tree = to_tree(self)
        del tree["board"]
        tree["dataset"] = str(self.dataset.absolute())
        if self.known.dataset:
            tree["known"]["dataset"] = str(self.known.dataset.absolute())
        tree |= {key: str(path.absolute()) for key in ("split", "cache") if (path := getattr(self, key))}
        tree["feature"] = {"name": name, **options}
        tree["heads"] = {
            head.replace("-", "_"): to_tree(HEADS.build(head, options))
            for head, options in self.heads.items()
        }
        if self.context.on:
            name, options = named(FEATURES, self.context.feature)
            tree["context"]["feature"] = {"name": name, **options}
        return tree


def named(registry: Registry[Feature], table: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return the name of the plug-in in a table, and all its options with their values."""
    options = dict(table)
    name = options.pop("name", None)
    if not isinstance(name, str):
        raise InputError(f"{registry.kind} without a name", ", ".join(registry.names()), "write its name")
    return name.replace("-", "_"), to_tree(registry.build(name, options))
