"""The settings of a training run."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from monochord.core.config import Tree, from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.ranges import Checked, Count, InnerShare
from monochord.core.registry import Registry
from monochord.datasets.augment import Augmentation
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Feature
from monochord.perception.heads import HEADS
from monochord.perception.heads.base import Head, Task
from monochord.perception.model.definition import Method

METHODS: tuple[Method, ...] = ("network", "ridge", "extra_trees")
DEFAULT_HEADS = ("contact", "slip", "position", "force")


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimiserSettings(Checked):
    """Settings of the optimiser: AdamW, whose rate falls to zero along half a cosine over all epochs.

    `rate` is the initial learning rate. `decay` is the weight decay for heads with hidden layers; biases and
    linear heads have none. `batch` is the number of windows in a step. Training ends after `epochs` epochs,
    or when no head has improved on validation for `patience` epochs. Each head keeps the weights of its best
    epoch. `threads` is PyTorch's number of threads; the result depends slightly on it.
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
            raise InputError(given, "rate times decay below 1")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSettings:
    """Settings of a training run.

    Parameters
    ----------
    title
        Title of the model.
    dataset
        Folder of the dataset.
    split
        File of the split; by default the split in the dataset's folder.
    sensor
        Name of the sensor's design; features are relative to its string.
    length_std
        Relative standard deviation of real strings' lengths about the design's. For a dataset whose strings
        all have the design's length; 0 where the labels are of the sensors that will be used.
    seed
        Random seed.
    feature
        Name and options of the feature.
    heads
        Options of each head to train, by name.
    methods
        Methods that learn the heads; each head keeps that with the smallest error on validation. Only
        "network" needs PyTorch. At equal errors, the first is kept.
    noise
        Noisy copies of training windows.
    faults
        Share of ordinary validation windows that may be reported as faults; 0 reports none. The feature must
        be ``reading``.
    corrections
        Variables of each head's correction for an unknown build and object, by head: columns of the feature,
        or the difference of two columns; see `monochord.perception.model.correction`.
    optimiser
        The optimiser and the end of training.
    cache
        Folder for cached features; by default ``features`` in the dataset's folder.
    board
        Also write TensorBoard events to ``board`` in the run's folder. The option does not affect training,
        so `resolved` leaves it out, and a run can be resumed with or without it.
    """

    title: str = ""
    dataset: Path = Path("dataset")
    split: Path | None = None
    sensor: str = "prototype"
    length_std: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.0
    seed: int = 0
    feature: dict[str, Any] = field(default_factory=lambda: {"name": "reading"})
    heads: dict[str, dict[str, Any]] = field(
        default_factory=lambda: dict[str, dict[str, Any]]((name, {}) for name in DEFAULT_HEADS)
    )
    methods: tuple[Method, ...] = METHODS
    noise: Augmentation = field(default_factory=Augmentation)
    faults: Annotated[float, Meta(ge=0.0, lt=0.5)] = 0.0
    corrections: dict[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    optimiser: OptimiserSettings = OptimiserSettings()
    cache: Path | None = None
    board: bool = False

    @classmethod
    def read(cls, tree: Mapping[str, Any]) -> "TrainingSettings":
        """Return settings from plain values, checked strictly; paths are relative to the working folder."""
        settings = from_tree(cls, tree)
        if settings.seed < 0:
            raise InputError(f"seed {settings.seed}", "0 or more")
        if not settings.methods or len(set(settings.methods)) < len(settings.methods):
            given = f"methods {', '.join(settings.methods) or '(none)'}"
            raise InputError(given, f"one or more of {', '.join(METHODS)}")
        return settings

    def tasks(self) -> dict[str, Task]:
        """Return the task of each head; raises `InputError` for an unknown head or option."""
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
        """Return the name and all options of the feature."""
        return named(FEATURES, self.feature)

    def resolved(self) -> Tree:
        """Return all settings to save with the run, with defaults and absolute paths."""
        name, options = self.feature_named()
        tree = to_tree(self)
        del tree["board"]
        tree["dataset"] = str(self.dataset.absolute())
        tree |= {key: str(path.absolute()) for key in ("split", "cache") if (path := getattr(self, key))}
        tree["feature"] = {"name": name, **options}
        tree["heads"] = {
            head.replace("-", "_"): to_tree(HEADS.build(head, options))
            for head, options in self.heads.items()
        }
        return tree


def named(registry: Registry[Feature], table: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return the name of a table's plug-in, and all its options with their values."""
    options = dict(table)
    name = options.pop("name", None)
    if not isinstance(name, str):
        raise InputError(f"{registry.kind} without a name", ", ".join(registry.names()), "add the key name")
    return name.replace("-", "_"), to_tree(registry.build(name, options))
