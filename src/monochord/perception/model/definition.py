"""The definition of a model: everything but the numbers that were learned, saved as text beside them."""

from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from itertools import pairwise
from math import inf
from typing import Annotated, Any, TypeAlias

from msgspec import Meta

from monochord.core.errors import InputError, did_you_mean
from monochord.core.ranges import Checked, Finite, InnerShare, NonNegative, Positive, Whole
from monochord.core.types import StringParams
from monochord.core.units import Metres, Samples, Seconds
from monochord.perception.heads.base import CONTACT, POSITION, Task
from monochord.perception.model import rise

FORMAT = 2
"""Version of a model's folder; 2 since heads have a linear path."""
DETECTOR = "known"
"""Prefix of the arrays of the detector of sound unlike that of the training."""
TOUCHES_KEPT = 64
"""Touches that a correction keeps, to say which would help most."""
MAX_COLUMNS, MAX_HEADS, MAX_LAYERS, MAX_PATTERNS, MAX_VARIABLES = 1 << 17, 64, 16, 64, 16
"""Bounds on what is read from a file, checked before it takes memory."""
Kept: TypeAlias = Annotated[int, Meta(ge=1, le=1000)]
"""Windows of the untouched reference."""
Pause: TypeAlias = Annotated[Seconds, Meta(ge=0.0, le=60.0)]
"""A time over which windows are averaged, or for which they are left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureRecord:
    """A feature by its name, with all its options, and its columns in training."""

    name: str
    options: dict[str, Any]
    columns: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference(Checked):
    """How the untouched reference is computed; see `monochord.perception.model.context`.

    `feature` is the feature of its windows. A window is believed untouched where the
    probability of contact is below `below`. The reference is the median of the last `keep` such windows,
    `every` or more apart, none of which began within `settle` after a window that was not believed untouched,
    or within `guard` before one.
    """

    feature: FeatureRecord
    below: InnerShare = 0.1
    keep: Kept = 8
    every: Pause = 0.1
    settle: Pause = 0.2
    guard: Pause = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration(Checked):
    """The calibration of a head's uncertainty on windows that it was not trained on.

    Logits of a probability are divided by `factor`; the standard error of a quantity is multiplied by it.
    `measured` holds coverage or calibration error on the `windows` of the `sessions` that it comes from,
    which hold `touches` separate touches.
    """

    factor: Positive[float] = 1.0
    windows: Whole = 0
    touches: Whole = 0
    sessions: Whole = 0
    measured: dict[str, float] = field(default_factory=dict[str, float])


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionRecord(Checked):
    """The correction of a head's errors on one build and object; see `monochord.perception.model.correction`.

    `variables` are its variables beside the head's own estimate: columns of the feature or of the reference,
    or the difference of two, as in "ratio open - open". `noise` is what it leaves over. Its prior is of the
    errors in `sessions` sessions, and it was calibrated by `touches` known touches, 0 for none.
    """

    variables: tuple[str, ...] = ()
    noise: Positive[float] = 1.0
    sessions: int = 0
    touches: int = 0

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if len(self.variables) > MAX_VARIABLES:
            raise InputError(f"{len(self.variables)} variables of a correction", f"{MAX_VARIABLES} at most")

    @property
    def terms(self) -> int:
        """Number of its terms."""
        count = 1 + len(self.variables)
        return 1 + count + count * (count + 1) // 2


@dataclass(frozen=True, slots=True, kw_only=True)
class AnomalyRecord(Checked):
    """The detector of sound unlike that of the training; see `monochord.perception.model.anomaly`.

    It has `hidden` layers and an output for sound like that of the training, then one for each of `reasons`.
    It sees the feature's `columns`, names or patterns as of a head, all for none.
    The log odds of each are averaged over its time in `memory`, and a window is abstained from where the
    score that follows is above `limit`. Reasons in `touched` are detected in touched windows alone: no other
    counts in their average, which so stays until the next touch. Beside reasons in `contact_holds` the head
    of contact is as right as ever, and only the others abstain; reasons in `brief` say that something
    touches, and contact abstains only where its head denies that. `measured` holds the shares of windows that
    are so in validation: of ordinary ones, and of each kind that was shown.
    """

    hidden: tuple[int, ...] = (64,)
    columns: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()
    memory: tuple[Pause, ...] = ()
    touched: tuple[str, ...] = ()
    brief: tuple[str, ...] = ()
    contact_holds: tuple[str, ...] = ()
    limit: Finite[float] = 0.0
    measured: dict[str, float] = field(default_factory=dict[str, float])

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if len(self.memory) != len(self.reasons):
            given = f"{len(self.memory)} times in the memory of a detector"
            raise InputError(given, f"{len(self.reasons)}, one for each reason")
        if len(self.hidden) > MAX_LAYERS or not 1 <= len(self.reasons) <= MAX_PATTERNS:
            given = f"{len(self.hidden)} hidden layers and {len(self.reasons)} reasons of a detector"
            raise InputError(given, f"{MAX_LAYERS} at most, and 1 to {MAX_PATTERNS}")
        for reason in (*self.touched, *self.brief, *self.contact_holds):
            if reason not in self.reasons:
                given = f"reason '{reason}', which is none of the detector's"
                raise InputError(given, ", ".join(self.reasons), did_you_mean(reason, self.reasons))
        if len(self.columns) > MAX_PATTERNS:
            raise InputError(
                f"{len(self.columns)} patterns of columns of a detector", f"{MAX_PATTERNS} at most"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadRecord(Checked):
    """A head: its task, and how its outputs relate to the label.

    A quantity is ``offset + scale`` times the network's output, and its standard error `scale` times the
    spread, both before calibration and correction.
    """

    task: Task
    offset: Finite[float] = 0.0
    scale: Positive[float] = 1.0
    calibration: Calibration = Calibration()
    correction: CorrectionRecord | None = None

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        patterns = max(len(self.task.columns), len(self.task.reference))
        if len(self.task.hidden) > MAX_LAYERS or patterns > MAX_PATTERNS:
            given = f"{len(self.task.hidden)} hidden layers and {patterns} patterns of columns"
            raise InputError(given, f"{MAX_LAYERS} and {MAX_PATTERNS} at most")


@dataclass(frozen=True, slots=True, kw_only=True)
class Definition(Checked):
    """A model without its arrays.

    `window` and `hop` are those of the training data, in frames. `known`, where there is one, detects sound
    unlike that of the training. `clip` bounds the scaled columns, so that an
    outlier is no larger than that; a window whose root mean square is below `quietest` is silence: the
    drivers do not drive the string. `string` is the string as the sensor's design states it, and
    `sensing_range` where along it, in m, the design can tell the place of a touch; where it states none, the
    places that the training had; None where neither is known.
    `sessions` are the checksums of the sessions that it was trained and calibrated on, by name; `dataset` is
    that of their dataset. `weights` is the sha256 of the file of weights.
    """

    format: int = FORMAT
    title: str = ""
    sample_rate: Annotated[int, Meta(ge=1, le=10_000_000)]
    channels: Annotated[int, Meta(ge=1, le=256)]
    window: Samples
    hop: Samples
    feature: FeatureRecord
    reference: Reference | None = None
    heads: dict[str, HeadRecord]
    known: AnomalyRecord | None = None
    clip: Positive[float] = 8.0
    quietest: NonNegative[float] = 0.0
    string: StringParams | None = None
    sensing_range: tuple[Metres, Metres] | None = None
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
                raise InputError(f"{name} {value} of a model", f"1 to {most}")
        if self.sensing_range is not None and not -inf < self.sensing_range[0] < self.sensing_range[1] < inf:
            given = f"sensing_range {self.sensing_range} of a model"
            raise InputError(given, "two places in m, the nearer one to pickup 1 first")
        if DETECTOR in self.heads:
            raise InputError(f"a head called {DETECTOR}", "another name: the detector's arrays are called so")
        if sum(record.task.label == CONTACT for record in self.heads.values()) != 1:
            given = f"heads {', '.join(self.heads) or '(none)'}"
            raise InputError(given, f"one that learns the label {CONTACT}, beside others", "add it")

    @property
    def gate(self) -> str:
        """Name of the head that estimates whether something touches."""
        return next(name for name, record in self.heads.items() if record.task.label == CONTACT)

    @property
    def place(self) -> str | None:
        """Name of the head that estimates the position of a touch; None without one."""
        heads = self.heads.items()
        return next((name for name, record in heads if record.task.label == POSITION), None)

    @property
    def widths(self) -> tuple[int, int]:
        """Columns of the window's own feature, and of the reference with its mark; 0 without one."""
        reference = self.reference
        return len(self.feature.columns), len(reference.feature.columns) + 1 if reference else 0

    def columns_of(self, name: str) -> tuple[int, ...]:
        """Return the indices of the feature's columns that a head sees.

        Raises
        ------
        InputError
            If a pattern of the head's columns fits none.
        """
        return _fitting(self.feature, self.heads[name].task.columns, f"the head '{name}'")

    @property
    def detector_columns(self) -> tuple[int, ...]:
        """The indices of the feature's columns that the detector of unlike sound sees.

        Raises
        ------
        InputError
            If a pattern of its columns fits none.
        """
        return (
            _fitting(self.feature, self.known.columns, "the detector of unlike sound") if self.known else ()
        )

    def reference_of(self, name: str) -> tuple[int, ...]:
        """Return the indices of the reference's columns that a head sees, with its mark; empty for none.

        Raises
        ------
        InputError
            If a pattern of the head's columns of the reference fits none.
        """
        task = self.heads[name].task
        if self.reference is None or not task.context:
            return ()
        return (*_fitting(self.reference.feature, task.reference, f"the head '{name}'"), self.widths[1] - 1)

    def variables_of(self, name: str) -> tuple[tuple[int, int], ...]:
        """Return the columns of each variable of a head's correction: of what, and less what, -1 for nothing.

        They are indices into the columns of the feature and, after them, of the reference.

        Raises
        ------
        InputError
            If a variable names no column.
        """
        columns = [*self.feature.columns, *(self.reference.feature.columns if self.reference else ())]
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
        return tuple(pairs)

    @property
    def rise_columns(self) -> tuple[int, ...]:
        """The columns that the rise of the pitch is computed from; empty if no head has it as an input.

        Raises
        ------
        InputError
            If feature or reference lack one of them.
        """
        wanted = [name for name, record in self.heads.items() if record.task.rise]
        if not wanted:
            return ()
        columns, reference = self.feature.columns, self.reference.feature.columns if self.reference else ()
        missing = [column for column in rise.COLUMNS if column not in columns]
        if missing or rise.REFERENCE not in reference:
            lacks = f"the column '{missing[0]}'" if missing else f"a reference with '{rise.REFERENCE}'"
            given = f"the input rise of the head '{wanted[0]}' without {lacks}"
            raise InputError(given, "fft_harmonic and context.on", "or set its rise = false")
        return (*(columns.index(column) for column in rise.COLUMNS), reference.index(rise.REFERENCE))

    def inputs(self, name: str) -> int:
        """Return how many inputs a head has: columns of the feature and of the reference, and the rise."""
        task = self.heads[name].task
        rises = rise.COUNT if task.rise and self.rise_columns else 0
        return len(self.columns_of(name)) + len(self.reference_of(name)) + rises

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the names and shapes of all weights.

        Scaling comes first, with the features of probe windows, then the layers of the detector, and each
        head's layers in the order in which they are applied, each with a matrix (outputs, inputs) and a bias
        (outputs,), or so many of both as the head has members, its linear path, and its correction, with the
        position, the force and the variables of some touches of all kinds.
        """
        base, context = self.widths
        shapes: dict[str, tuple[int, ...]] = {
            "scaler.mean": (base,),
            "scaler.scale": (base,),
            "scaler.probe": (3, base),
        }
        if context:
            shapes |= {
                "context.mean": (context,),
                "context.scale": (context,),
                "context.probe": (3, context - 1),
            }
        if self.known:
            units = (len(self.detector_columns), *self.known.hidden, 1 + len(self.known.reasons))
            for number, (inputs, outputs) in enumerate(pairwise(units)):
                shapes[f"{DETECTOR}.{number}.weight"] = (outputs, inputs)
                shapes[f"{DETECTOR}.{number}.bias"] = (outputs,)
        for name, record in self.heads.items():
            units = (self.inputs(name), *record.task.hidden, record.task.outputs)
            members = (record.task.members,) if record.task.members > 1 else ()
            for number, (inputs, outputs) in enumerate(pairwise(units)):
                shapes[f"{name}.{number}.weight"] = (*members, outputs, inputs)
                shapes[f"{name}.{number}.bias"] = (*members, outputs)
            if record.task.linear:
                shapes[f"{name}.linear.weight"] = (1, self.inputs(name))
                shapes[f"{name}.linear.bias"] = (1,)
            if record.correction:
                count, terms = 1 + len(record.correction.variables), record.correction.terms
                shapes[f"{name}.correction.centre"] = shapes[f"{name}.correction.scale"] = (count,)
                shapes[f"{name}.correction.mean"] = (terms,)
                shapes[f"{name}.correction.covariance"] = (terms, terms)
                shapes[f"{name}.correction.touches"] = (TOUCHES_KEPT, 2 + count)
        return shapes


def _fitting(feature: FeatureRecord, patterns: tuple[str, ...], whose: str) -> tuple[int, ...]:
    """Return the indices of the columns of a feature that fit one of the patterns, all for no pattern."""
    columns = feature.columns
    for pattern in patterns:
        if not any(fnmatchcase(column, pattern) for column in columns):
            given = f"columns '{pattern}' for {whose}"
            such = f"such as '{columns[0]}'" if columns else "which has none here"
            raise InputError(given, f"those of {feature.name}, {such}")
    return tuple(
        index
        for index, column in enumerate(columns)
        if not patterns or any(fnmatchcase(column, pattern) for pattern in patterns)
    )
