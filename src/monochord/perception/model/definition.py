"""The definition of a model: everything except the learned weights, saved as text next to them."""

from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache
from itertools import pairwise
from math import inf
from typing import Annotated, Any, Literal, TypeAlias

from msgspec import Meta

from monochord.core.errors import InputError, did_you_mean
from monochord.core.identity import SensorIdentity
from monochord.core.ranges import Checked, Finite, NonNegative, Positive, Whole
from monochord.core.types import StringParams
from monochord.core.units import Metres, Samples
from monochord.perception.heads.base import CERTAINTY, CONTACT, POSITION, Task
from monochord.perception.model.faults import FAULTS

FORMAT, OLDEST = 5, 3
"""Version of the format of a model's folder, and the oldest that is read."""
CLIP = 8.0
"""Largest magnitude of a scaled column, in standard deviations of the training. Without it, a column that
hardly varies in training could drive an estimate anywhere."""
ORDINARY = "ordinary"
"""Kind of a window without a fault."""
TOUCHES_KEPT = 64
"""Number of touches that a correction stores, as candidates for the most helpful next touch."""
MAX_COLUMNS, MAX_HEADS, MAX_LAYERS, MAX_PATTERNS, MAX_VARIABLES = 1 << 17, 64, 16, 64, 16
MAX_NODES = 1 << 23
"""Bounds on the contents of a file, checked before memory is allocated."""
Method: TypeAlias = Literal["network", "ridge", "extra_trees"]
"""How a head was learned: layers of a network, ridge regression (logistic regression of a probability), or
extremely randomized trees."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureRecord:
    """The name of a feature, all its options, and its columns in training."""

    name: str
    options: dict[str, Any]
    columns: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration(Checked):
    """The scaling of a head's uncertainty, from windows that the head was not trained on.

    The logit of a probability is divided by `factor`; the standard error of a quantity is multiplied by it.
    `windows`, `touches` and `sessions` are the numbers of windows, separate touches and sessions behind the
    factor. `measured` holds the coverage or the calibration error on them.
    """

    factor: Positive[float] = 1.0
    windows: Whole = 0
    touches: Whole = 0
    sessions: Whole = 0
    measured: dict[str, float] = field(default_factory=dict[str, float])


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionRecord(Checked):
    """The correction of a head's errors on one build and object; see `monochord.perception.model.correction`.

    `variables` are inputs in addition to the head's own estimate: columns of the feature, or the difference
    of two columns, as in "ratio open - open". `noise` is the residual variance, as a multiple
    of the head's own. With `residual`, all columns of the feature are inputs too, for trees with this number
    of `nodes`. `sessions` is the number of sessions behind the prior, and `touches` the number of known
    touches that the correction has learned.
    """

    variables: tuple[str, ...] = ()
    residual: bool = False
    nodes: Whole = 0
    noise: Positive[float] = 1.0
    sessions: int = 0
    touches: int = 0

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if len(self.variables) > MAX_VARIABLES:
            raise InputError(f"{len(self.variables)} variables of a correction", f"at most {MAX_VARIABLES}")
        if self.nodes > MAX_NODES:
            raise InputError(f"{self.nodes} nodes of a correction", f"at most {MAX_NODES}")

    @property
    def terms(self) -> int:
        """Number of terms of the correction."""
        count = 1 + len(self.variables)
        return 1 + count + count * (count + 1) // 2


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultRecord(Checked):
    """When a model reports a fault; see `monochord.perception.model.faults`.

    The model abstains from a window if the log odds of a fault exceed its one of `limits`, in the order of
    `FAULTS`. `measured` holds the share of ordinary validation windows above any limit.
    """

    limits: tuple[Finite[float], ...]
    measured: dict[str, float] = field(default_factory=dict[str, float])

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if len(self.limits) != len(FAULTS):
            raise InputError(f"{len(self.limits)} limits of faults", f"{len(FAULTS)}, one for each fault")


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadRecord(Checked):
    """A head: its task, the method that learned it, and the scaling from outputs to the label.

    A quantity is ``offset + scale * output``, and its standard error is ``scale * spread``, both before
    calibration and correction. With ridge and trees the task has no hidden layers; trees of this number of
    `nodes` add to the first output of its one layer.
    """

    task: Task
    method: Method = "network"
    nodes: Whole = 0
    offset: Finite[float] = 0.0
    scale: Positive[float] = 1.0
    calibration: Calibration = Calibration()
    correction: CorrectionRecord | None = None

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        patterns = len(self.task.columns)
        if len(self.task.hidden) > MAX_LAYERS or patterns > MAX_PATTERNS:
            given = f"{len(self.task.hidden)} hidden layers and {patterns} patterns of columns"
            raise InputError(given, f"at most {MAX_LAYERS} layers and {MAX_PATTERNS} patterns")
        if self.nodes > MAX_NODES:
            raise InputError(f"{self.nodes} nodes of a head", f"at most {MAX_NODES}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Definition(Checked):
    """A model without its arrays.

    `sample_rate` (Hz), `channels`, and `window` and `hop` (frames) describe the training data. `faults` says
    when a fault is reported; None for never. `clip` limits the magnitude of scaled columns, for outliers. A
    window whose root mean square is below `quietest` is silence: no driver drives the string.

    `string` is the string of the sensor's design. `sensing_range` is the range of positions in m that the
    model can estimate, from the design and the training data; None if unknown. `length_std` is the relative
    standard deviation of real strings' lengths about the design's, where all strings of the training had the
    design's length; stated errors of position include it. `calibrated_on` is the sensor of the known touches
    that the model was adapted to; None for no such touches, or touches of several or unknown sensors.
    `sessions` maps the names of
    the sessions of training and calibration to their checksums, and `dataset` is the checksum of their
    dataset. `weights` is the SHA-256 of the weights file.
    """

    format: int = FORMAT
    title: str = ""
    sample_rate: Annotated[int, Meta(ge=1, le=10_000_000)]
    channels: Annotated[int, Meta(ge=1, le=256)]
    window: Samples
    hop: Samples
    feature: FeatureRecord
    heads: dict[str, HeadRecord]
    faults: FaultRecord | None = None
    clip: Positive[float] = CLIP
    quietest: NonNegative[float] = 0.0
    string: StringParams | None = None
    sensing_range: tuple[Metres, Metres] | None = None
    length_std: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.0
    calibrated_on: SensorIdentity | None = None
    simulated: bool = False
    dataset: str = ""
    sessions: dict[str, str] = field(default_factory=dict[str, str])
    versions: dict[str, str] = field(default_factory=dict[str, str])
    weights: str = ""

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        for name, value, most in (
            ("window", self.window, 60 * self.sample_rate),
            ("hop", self.hop, 60 * self.sample_rate),
            ("columns", len(self.feature.columns) or 1, MAX_COLUMNS),
            ("heads", len(self.heads) or 1, MAX_HEADS),
        ):
            if not 1 <= value <= most:
                raise InputError(f"a model with {name} {value}", f"1 to {most}")
        if self.sensing_range is not None and not 0.0 <= self.sensing_range[0] < self.sensing_range[1] < inf:
            given = f"sensing_range {self.sensing_range} of a model"
            raise InputError(given, "two positions in m from pickup 1, the smaller one first")
        if sum(record.task.label == CONTACT for record in self.heads.values()) != 1:
            given = f"heads {', '.join(self.heads) or '(none)'}"
            raise InputError(given, f"one that learns the label {CONTACT}, beside others", "add it")

    def __repr__(self) -> str:
        heads = ", ".join(self.heads)
        return f"Definition: {self.title or 'untitled'}; heads {heads}; feature {self.feature.name}"

    @property
    def gate(self) -> str:
        """Name of the head that estimates contact."""
        return next(name for name, record in self.heads.items() if record.task.label == CONTACT)

    @property
    def place(self) -> str | None:
        """Name of the head that estimates position; None without one."""
        heads = self.heads.items()
        return next((name for name, record in heads if record.task.label == POSITION), None)

    def columns_of(self, name: str) -> tuple[int, ...]:
        """Return the indices of the feature's columns that are inputs of a head.

        Raises
        ------
        InputError
            If a pattern in the head's `columns` matches no column.
        """
        return _fitting(self.feature, self.heads[name].task.columns, f"the head '{name}'")

    @property
    def fault_columns(self) -> tuple[int, ...]:
        """The indices of the kinds, an ordinary window and each fault; or empty.

        Raises
        ------
        InputError
            If the feature lacks one of these columns.
        """
        if self.faults is None:
            return ()
        columns = self.feature.columns
        wanted = [f"kind {kind}" for kind in (ORDINARY, *FAULTS)]
        missing = [column for column in wanted if column not in columns]
        if missing:
            given = f"faults of a model whose feature lacks the column '{missing[0]}'"
            raise InputError(given, "the feature reading", "or set faults = 0")
        return tuple(map(columns.index, wanted))

    def variables_of(self, name: str) -> tuple[tuple[int, int], ...]:
        """Return a pair of column indices for each variable of a head's correction.

        A variable is the first column minus the second; -1 stands for no second column. All columns follow
        where trees need them.

        Raises
        ------
        InputError
            If a variable names an unknown column.
        """
        columns = self.feature.columns
        correction = self.heads[name].correction

        def index(column: str) -> int:
            if column not in columns:
                remedy = did_you_mean(column, columns)
                raise InputError(f"variable '{column}' of a correction of {name}", "a column's name", remedy)
            return columns.index(column)

        pairs: list[tuple[int, int]] = []
        for variable in correction.variables if correction else ():
            of, minus, less = variable.partition(" - ")
            pairs.append((index(of), index(less) if minus else -1))
        residual = range(len(self.feature.columns)) if correction and correction.residual else ()
        return (*pairs, *((column, -1) for column in residual))

    def refined(self, name: str) -> int | None:
        """Return the index of the column that a head refines; None if it refines none.

        Raises
        ------
        InputError
            If the feature lacks the column, or the string's length is not known.
        """
        column, columns = self.heads[name].task.refines, self.feature.columns
        if not column:
            return None
        missing = [f"the column '{each}'" for each in (column, CERTAINTY) if each not in columns]
        if missing or self.string is None:
            lacks = missing[0] if missing else "a string of known length"
            given = f"refines = '{column}' for the head '{name}' without {lacks}"
            raise InputError(given, "a position over the string's length", "use the feature reading")
        return columns.index(column)

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the names and shapes of all weights.

        Their order is:

        - the scaling, with the features of the probe windows;
        - for each head, its layers in order, its trees and its correction.

        A layer has a matrix (outputs, inputs) and a bias (outputs,). A correction includes position, force
        and variables of representative touches.
        """
        base = len(self.feature.columns)
        shapes: dict[str, tuple[int, ...]] = {
            "scaler.mean": (base,),
            "scaler.scale": (base,),
            "scaler.probe": (3, base),
        }
        for name, record in self.heads.items():
            units = (len(self.columns_of(name)), *record.task.hidden, record.task.outputs)
            for number, (inputs, outputs) in enumerate(pairwise(units)):
                shapes[f"{name}.{number}.weight"] = (outputs, inputs)
                shapes[f"{name}.{number}.bias"] = (outputs,)
            if record.nodes:
                shapes[f"{name}.forest"] = (record.nodes, 3)
            if record.correction:
                count, terms = 1 + len(record.correction.variables), record.correction.terms
                shapes[f"{name}.correction.centre"] = (count,)
                shapes[f"{name}.correction.scale"] = (count,)
                shapes[f"{name}.correction.mean"] = (terms,)
                shapes[f"{name}.correction.covariance"] = (terms, terms)
                shapes[f"{name}.correction.touches"] = (TOUCHES_KEPT, 2 + count)
                if record.correction.nodes:
                    shapes[f"{name}.correction.forest"] = (record.correction.nodes, 3)
        return shapes


def _fitting(feature: FeatureRecord, patterns: tuple[str, ...], whose: str) -> tuple[int, ...]:
    """Return the indices of the columns of a feature that fit one of the patterns, all for no pattern."""
    columns = feature.columns
    for pattern in patterns:
        if not _indices(columns, (pattern,)):
            given = f"columns '{pattern}' for {whose}"
            such = f"such as '{columns[0]}'" if columns else "which has no columns"
            raise InputError(given, f"columns of {feature.name}, {such}")
    return _indices(columns, patterns or ("*",))


@lru_cache(maxsize=128)
def _indices(columns: tuple[str, ...], patterns: tuple[str, ...]) -> tuple[int, ...]:
    """Return the indices of the columns that fit one of the patterns; a model asks for them many times."""
    return tuple(
        index
        for index, column in enumerate(columns)
        if any(fnmatchcase(column, pattern) for pattern in patterns)
    )
