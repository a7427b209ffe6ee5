"""Selects the estimator and the windows to evaluate, from sessions that it was not trained on.

`select` refuses a split that leaks and sessions that a model was trained on, to keep test and training data
apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from monochord.core.config import Tree, load_toml
from monochord.core.errors import InputError
from monochord.core.identity import SensorIdentity, calibrated_elsewhere
from monochord.core.types import StringParams
from monochord.core.units import Newtons, Seconds
from monochord.core.workers import ONE_PROCESS, Spread
from monochord.datasets.audit import audit
from monochord.datasets.build import BuildOptions, build_dataset, find_sessions, named_sessions
from monochord.datasets.split import SPLIT_FILE, Split
from monochord.datasets.store import Dataset, open_dataset
from monochord.evaluation.limits import force_floor
from monochord.evaluation.paper import labelled
from monochord.evaluation.replay import Selection
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import load as load_model
from monochord.perception.model.definition import Definition
from monochord.perception.training.run_folder import CONFIG
from monochord.perception.tuning.sessions import tension_estimator
from monochord.physics.sensors import RULER_STD, load_sensor, same_wire
from monochord.sessions import read_session

LABELS = ("contact", "position", "force", "slip")
"""Labels used for scoring."""
RANDOM = "random"
"""Column prefix of a feature with random weights."""
DEFAULT_FEATURE: Tree = {"name": "reading"}
"""Feature of the baselines for an estimator without one."""

Part: TypeAlias = Literal["test", "validation"]


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluationSettings:
    """The estimator and the data of an evaluation.

    Parameters
    ----------
    model
        Folder of a model or of its training run, or the name of a bundled model; None to use `estimator`.
    estimator, options
        Name of an estimator other than a model, and the options of the evaluated one.
    dataset, split, part
        A dataset, the file of its split, and the part to evaluate; by default those of the training run.
    sessions
        Session files, folders or patterns to evaluate instead of a dataset.
    skip
        Whether to leave out sessions that cannot be used; a note names each.
    sensor
        Sensor preset whose string the estimator gets.
    tuned
        Whether to tune that string to each session's untouched beginning, as by ``monochord tune``. A session
        recorded with a tuned sensor always uses that tuning.
    noises
        Noises such as ``white:10``, each added in a separate replay.
    suite
        Whether to add every kind of noise at every ratio of `noise.SUITE_RATIOS`.
    seed
        Random seed of the noise.
    baselines
        Whether to fit and evaluate ridge regression and extra trees on the same feature.
    """

    model: str | None = None
    estimator: str = "closed_form"
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    dataset: Path | None = None
    split: Path | None = None
    part: Part = "test"
    sessions: tuple[str, ...] = ()
    skip: bool = False
    sensor: str | None = None
    tuned: bool = False
    noises: tuple[str, ...] = ()
    suite: bool = False
    seed: int = 0
    baselines: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluatedEstimator:
    """The evaluated estimator; for a model, with its definition and training settings."""

    estimator: Estimator
    name: str
    definition: Definition | None = None
    config: Tree = field(default_factory=dict[str, Any])

    @property
    def random_weights(self) -> bool:
        """Whether its feature's weights are random."""
        definition = self.definition
        return definition is not None and any(name.startswith(RANDOM) for name in definition.feature.columns)

    @property
    def feature(self) -> Tree:
        """Name and options of its feature, `DEFAULT_FEATURE` where it has none."""
        if self.definition is None:
            return DEFAULT_FEATURE
        return {"name": self.definition.feature.name, **self.definition.feature.options}

    @property
    def label(self) -> str:
        """Its name in tables that compare features."""
        name = self.definition.feature.name if self.definition else self.name
        return labelled(name, random=self.random_weights)

    @property
    def about(self) -> Tree:
        """Facts about a model's origin, for the readers of its results."""
        definition = self.definition
        if definition is None:
            return {}
        return {
            "feature": self.feature,
            "heads": list(definition.heads),
            "weights": definition.weights,
            "trained_on_sessions": len(definition.sessions),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluationData:
    """The windows to evaluate, and those to fit baselines to.

    `force_floor` is the force sensor's error by session, in N; `notes` are what a reader must know.
    """

    selection: Selection
    training: Selection | None = None
    force_floor: Mapping[str, Newtons] = field(default_factory=dict[str, Newtons])
    notes: tuple[str, ...] = ()


def load(settings: EvaluationSettings) -> EvaluatedEstimator:
    """Return the estimator to evaluate.

    Raises
    ------
    InputError
        If the model, estimator or option does not exist.

    Examples
    --------
    >>> load(EvaluationSettings(model="demo")).definition.simulated
    True
    """
    if settings.model is None:
        name = settings.estimator.replace("-", "_")
        return EvaluatedEstimator(estimator=ESTIMATORS.build(name, settings.options), name=name)
    file = Path(settings.model) / CONFIG
    return EvaluatedEstimator(
        estimator=ESTIMATORS.build("model", {"path": settings.model, **settings.options}),
        name="model",
        definition=load_model(settings.model).definition,
        config=load_toml(file) if file.is_file() else {},
    )


def select(
    settings: EvaluationSettings,
    candidate: EvaluatedEstimator,
    scratch: Path,
    spread: Spread = ONE_PROCESS,
) -> EvaluationData:
    """Return the windows to evaluate: a part of a split, or whole sessions as a dataset in `scratch`.

    `spread` reads the sessions.

    Raises
    ------
    InputError
        If there is nothing to evaluate, a split leaks, a session was used for training, or labels are
        unusable.

    Examples
    --------
    ``monochord evaluate --dataset DIR`` selects its test part.
    """
    definition, config = candidate.definition, candidate.config
    sensor = load_sensor(settings.sensor) if settings.sensor else None
    string, sensing_range = (sensor.string, sensor.range) if sensor else (None, None)
    if string is None and definition is not None:
        string = definition.string
    split: Split | None = None
    if settings.sessions:
        if settings.dataset is not None:
            raise InputError("--sessions with --dataset", "only one of them")
        files, window, dataset = _dataset_of_sessions(settings, definition, scratch, spread)
        floors, stated = _known_of_sessions(files, window)
        rows = np.arange(len(dataset))
        string = string or stated
        notes = tuple(f"left out: {reason}" for reason in dataset.manifest.refused.values())
    else:
        folder = settings.dataset or (Path(config["dataset"]) if config.get("dataset") else None)
        if folder is None:
            raise InputError("no sessions to evaluate", "--dataset DIR or --sessions FILES", "name some")
        trained_with = config.get("split") if settings.dataset is None else None
        dataset, floors = open_dataset(folder), dict[str, Newtons]()
        split = Split.read(settings.split or Path(trained_with or folder / SPLIT_FILE))
        notes = audited(dataset, split, learned=definition is not None)
        if settings.part != "test":
            notes += (f"the {settings.part} part was used to choose the model, so it is not a test",)
        rows = split.parts[settings.part]
    selection = Selection(
        dataset=dataset,
        rows=rows,
        string=string,
        length_std=RULER_STD if sensor and sensor.measured_length else None,
        sensing_range=sensing_range,
        tuned=settings.tuned,
    )
    refuse_unusable_labels(selection)
    if definition is not None and not (split and settings.part != "test"):
        notes += refuse_trained_on(selection, definition, split)
    notes += _calibrated_elsewhere(definition, selection)
    if candidate.random_weights and definition is not None:
        notes += (f"the weights of the feature {definition.feature.name} are random: it was not trained",)
    training: Selection | None = None
    if settings.baselines and split is not None:
        training = _fitting_rows(selection.dataset, split, selection.string)
    elif settings.baselines:
        training = training_of(candidate, selection.string)
    return EvaluationData(selection=selection, training=training, force_floor=floors, notes=notes)


def _calibrated_elsewhere(definition: Definition | None, selection: Selection) -> tuple[str, ...]:
    """Return the note that a model was calibrated on another sensor than some sessions are of."""
    if definition is None or definition.calibrated_on is None:
        return ()
    parts = selection.dataset.manifest.parts
    said = {
        calibrated_elsewhere(
            definition.calibrated_on, SensorIdentity(build=part.build, length=part.measured_length)
        ): None
        for part in (parts[number] for number in np.unique(selection.dataset.session[selection.rows]))
    }
    return tuple(filter(None, said))[:1]


def audited(dataset: Dataset, split: Split, *, learned: bool = True) -> tuple[str, ...]:
    """Return the notes of a split's audit; `InputError` refuses one that leaks or is of another dataset.

    For an estimator that learned nothing from the dataset, sounds are not compared.
    """
    report = audit(dataset, split, duplicates=learned)
    if learned or any(leak.kind == "other dataset" for leak in report.leaks):
        report.refuse_leaks()
    return tuple(report.notes) if learned else ()


def refuse_trained_on(selection: Selection, definition: Definition, split: Split | None) -> tuple[str, ...]:
    """Return the notes of a test; raises `InputError` for a session that the model was trained on.

    A session is recognised by its checksum, whatever its name. With a split by time of the training dataset,
    other stretches of a session may have been used for training; a note then says so.

    Raises
    ------
    InputError
        If a session was used for training.
    """
    parts = selection.dataset.manifest.parts
    trained_on = set(definition.sessions.values())
    both = [parts[at].name for at in selection.sessions if parts[at].checksum in trained_on]
    if not both:
        return ()
    if split is not None and split.by == "time" and split.dataset == definition.dataset:
        return (f"{len(both)} of the tested sessions also have stretches in the training data",)
    more = f" and {len(both) - 1} more" if len(both) > 1 else ""
    given = f"a test on session {both[0]}{more}, which the model was trained on"
    raise InputError(given, "other sessions", "use the split of its training")


def refuse_unusable_labels(selection: Selection) -> None:
    """Raise `InputError` for a selection without known labels, or with a valid label that is not finite."""
    dataset, rows, known = selection.dataset, selection.rows, 0
    for name in LABELS:
        if name not in dataset.manifest.columns:
            continue
        values, valid = dataset.labels[name][rows], np.asarray(dataset.valid[name][rows])
        strange = int((~np.isfinite(values[valid])).sum())
        if strange:
            given = f"label '{name}' is marked valid but not finite in {strange} windows"
            raise InputError(given, "numbers", "build the dataset again")
        known += int(valid.sum())
    if not known:
        given = f"{rows.size} windows without labels"
        raise InputError(given, f"some with {', '.join(LABELS)}", "use sessions with labels")


def _dataset_of_sessions(
    settings: EvaluationSettings, definition: Definition | None, scratch: Path, spread: Spread
) -> tuple[list[Path], Seconds, Dataset]:
    """Return the files of the sessions that are used, the window length, and their dataset."""
    files = find_sessions(settings.sessions)
    window = hop = 0.1
    if definition is not None:
        window, hop = (size / definition.sample_rate for size in (definition.window, definition.hop))
    rate = definition.sample_rate if definition else None
    options = BuildOptions(window=window, hop=hop, sample_rate=rate, skip=settings.skip)
    listen = tension_estimator(definition.string if definition else None)
    dataset = build_dataset(
        files,
        scratch / "dataset",
        options,
        spread.progress,
        listen,
        workers=spread.workers,
        cluster=spread.cluster,
    )
    refused = dataset.manifest.refused
    return [path for name, path in named_sessions(files).items() if name not in refused], window, dataset


def _known_of_sessions(
    files: Sequence[Path], window: Seconds
) -> tuple[dict[str, Newtons], StringParams | None]:
    """Return the force sensors' errors in the sessions, and the string that all sessions state."""
    sessions = {path.stem: read_session(path) for path in files}
    strings = [session.description.string for session in sessions.values()]
    floors = {name: force_floor(session, window) for name, session in sessions.items()}
    known = {name: floor for name, floor in floors.items() if floor is not None}
    first = strings[0]
    is_one = all(string and first and same_wire(string, first) for string in strings)
    return known, first if is_one else None


def training_of(candidate: EvaluatedEstimator, string: StringParams | None) -> Selection | None:
    """Return a model's training windows, for baselines; None where they are unavailable.

    Examples
    --------
    ``monochord evaluate run --sessions FILES`` fits its baselines to them.
    """
    config = candidate.config
    folder = Path(config["dataset"]) if config.get("dataset") else None
    if folder is None or not folder.is_dir():
        return None
    return _fitting_rows(
        open_dataset(folder), Split.read(Path(config.get("split") or folder / SPLIT_FILE)), string
    )


def _fitting_rows(dataset: Dataset, split: Split, string: StringParams | None) -> Selection | None:
    """Return the usable windows of the training part; None if there are none."""
    rows = split.train[dataset.usable[split.train]]
    return Selection(dataset=dataset, rows=rows, string=string) if len(rows) else None
