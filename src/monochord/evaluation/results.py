"""What an estimator said of windows whose truth is known: what every score and figure is read off."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Metres, Seconds

CLEAN = "clean"
"""The condition in which nothing disturbs."""
COLUMNS = ("truth", "value", "std", "why")
"""Fields of `Results` that map names to columns."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One session as it was heard in one condition.

    `noise` names what disturbs, empty for nothing. With a `ratio` in dB it was added to the recording;
    without one it was in the room. `checksum` is that of the session's file.

    >>> Trial(session="a").condition, Trial(session="a", noise="white", ratio=5.0).condition
    ('clean', 'white 5 dB')
    """

    session: str
    object: str = ""
    noise: str = ""
    ratio: float | None = None
    radius: Metres | None = None
    day: int | None = None
    build: int | None = None
    simulated: bool = False
    checksum: str = ""

    @property
    def condition(self) -> str:
        """The condition in words, as tables have it."""
        if not self.noise:
            return CLEAN
        return self.noise if self.ratio is None else f"{self.noise} {self.ratio:g} dB"


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """Estimates beside the truth, a row a window, in the order of the trials and of time.

    `trial` (n,) numbers `trials`; `start` (n,) is the window's begin in s of its session; `usable` (n,) tells
    whether its every sample was recorded. `truth` has the labels by name, `value` and `std` the estimates,
    each (n,), in SI units, NaN where not known or not told. `why` (n,) numbers `reasons`: 0, an empty reason,
    where an estimate is valid, else why there is none. `window` and `hop` are in s; `estimator` is its name
    and `options` what it was set to, `notes` what a reader has to know.
    """

    estimator: str
    window: Seconds
    hop: Seconds
    trials: tuple[Trial, ...]
    trial: NDArray[np.int32]
    start: Floats
    usable: NDArray[np.bool_]
    truth: Mapping[str, Floats]
    value: Mapping[str, Floats]
    std: Mapping[str, Floats]
    why: Mapping[str, NDArray[np.int16]]
    reasons: tuple[str, ...] = ("",)
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.trial)

    @property
    def simulated(self) -> bool:
        """Whether any of the sound is simulated."""
        return any(trial.simulated for trial in self.trials)

    def of_trials(self, name: str) -> NDArray[Any]:
        """Return what the trials say under a name (``object``, ``condition``, ``day`` ...), a row each (n,).

        Text where it is text; numbers are NaN where a trial does not tell.
        """
        told = [getattr(trial, name) for trial in self.trials]
        return np.array([np.nan if each is None else each for each in told])[self.trial]

    def label(self, name: str) -> Floats:
        """Return a label (n,); NaN throughout where there is none of this name."""
        return self.truth.get(name, np.full(len(self), np.nan))

    def estimate(self, name: str) -> Floats:
        """Return an estimate (n,); NaN where it abstained, throughout where there is none of this name."""
        return self.value.get(name, np.full(len(self), np.nan))

    def error_of(self, name: str) -> Floats:
        """Return the estimate minus the label (n,), NaN where either is missing."""
        return self.estimate(name) - self.label(name)

    def where(self, rows: NDArray[np.bool_]) -> "Results":
        """Return the rows (n,) that are asked for; all trials stay."""
        each = {name: {key: column[rows] for key, column in getattr(self, name).items()} for name in COLUMNS}
        return replace(self, trial=self.trial[rows], start=self.start[rows], usable=self.usable[rows], **each)


def join(parts: Sequence[Results]) -> Results:
    """Return results of one estimator in several conditions as one.

    Columns that a part has not are NaN in its rows.

    Raises
    ------
    InputError
        If there are none, or they differ in estimator, window or hop.

    Examples
    --------
    >>> one = Results(
    ...     estimator="none",
    ...     window=0.1,
    ...     hop=0.1,
    ...     trials=(Trial(session="a"),),
    ...     trial=np.zeros(2, np.int32),
    ...     start=np.array([0.0, 0.1]),
    ...     usable=np.ones(2, bool),
    ...     truth={},
    ...     value={},
    ...     std={},
    ...     why={},
    ... )
    >>> join([one, one]).trial.tolist()
    [0, 0, 1, 1]
    """
    if not parts:
        raise InputError("no results to join", "one or more")
    first = parts[0]
    for part in parts:
        if (part.estimator, part.window, part.hop) != (first.estimator, first.window, first.hop):
            given = f"results of {part.estimator}, window {part.window:g} s, beside {first.estimator}"
            raise InputError(given, "one estimator, window and hop")
    reasons = tuple(dict.fromkeys(reason for part in parts for reason in part.reasons))
    number = {reason: at for at, reason in enumerate(reasons)}
    shifts = np.cumsum([0, *(len(part.trials) for part in parts)]).tolist()
    columns = {
        kind: {
            name: np.concatenate([_column(part, kind, name, number) for part in parts])
            for name in dict.fromkeys(name for part in parts for name in getattr(part, kind))
        }
        for kind in COLUMNS
    }
    moved = [part.trial + shift for part, shift in zip(parts, shifts, strict=False)]
    return replace(
        first,
        trials=tuple(trial for part in parts for trial in part.trials),
        trial=np.concatenate(moved).astype(np.int32),
        start=np.concatenate([part.start for part in parts]),
        usable=np.concatenate([part.usable for part in parts]),
        reasons=reasons,
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        **columns,
    )


def _column(part: Results, kind: str, name: str, number: Mapping[str, int]) -> NDArray[Any]:
    held = getattr(part, kind)
    if kind == "why":
        own = np.array([number[reason] for reason in part.reasons], np.int16)
        return own[held[name]] if name in held else np.zeros(len(part), np.int16)
    return held.get(name, np.full(len(part), np.nan))
