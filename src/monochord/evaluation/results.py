"""An estimator's predictions for windows with ground truth, in memory and on disk.

Every score and every figure of an evaluation is computed from `Results`. On disk they are one ``.npz`` of
plain arrays, which NumPy reads without pickle: ``trial``, ``start`` and ``usable``, then ``truth.NAME``,
``value.NAME``, ``std.NAME`` and ``why.NAME`` for every label and estimate, each (n,), and ``about``, a JSON
text with the rest. `write_csv` writes the same as a table of text.
"""

import csv
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.files import replacing
from monochord.core.types import Floats
from monochord.core.units import Metres, Seconds

CLEAN = "clean"
"""The condition without noise."""
COLUMNS = {"truth": "truth", "value": "value", "std": "std", "reason_index": "why"}
"""Fields of `Results` that map names to columns, with their key prefix in a file."""
FORMAT = 1
"""Version of the on-disk format."""
ROWS = ("trial", "start", "usable")
"""Fields of `Results` with one value per window."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One session in one condition.

    `noise` names the noise, empty for none. With a `ratio` in dB it was added to the recording; without, it
    was present during the recording. `checksum` is that of the session's file. `mount` is the
    class of its object's mount, empty where unknown.

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
    mount: str = ""

    @property
    def condition(self) -> str:
        """The condition as shown in tables."""
        if not self.noise:
            return CLEAN
        return self.noise if self.ratio is None else f"{self.noise} {self.ratio:g} dB"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Results:
    """Estimates beside the truth, one row per window, in order of trial and time.

    `trial` (n,) indexes `trials`; `start` (n,) is the window's start in s since its session's; `usable` (n,)
    marks windows without lost samples. `truth` holds the labels by name, `value` and `std` the estimates,
    each (n,), in SI units, NaN where unknown or where the estimator abstained. `reason_index` (n,) indexes
    `reasons`: 0, an empty reason, where the estimate is valid, else the reason of the abstention. `window`
    and `hop` are in s; `estimator` is the estimator's name, `options` its options, `notes` what a reader must
    know.
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
    reason_index: Mapping[str, NDArray[np.int16]]
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
        """Return a field of the trials (``object``, ``condition``, ``day`` ...) for each window (n,).

        A text field gives text; a number is NaN where a trial leaves the field unknown.
        """
        values = [getattr(trial, name) for trial in self.trials]
        return np.array([np.nan if value is None else value for value in values])[self.trial]

    def label(self, name: str) -> Floats:
        """Return a label (n,), all NaN for an unknown name."""
        return self.truth.get(name, np.full(len(self), np.nan))

    def estimate(self, name: str) -> Floats:
        """Return an estimate (n,), NaN where it abstained, all NaN for an unknown name."""
        return self.value.get(name, np.full(len(self), np.nan))

    def error_of(self, name: str) -> Floats:
        """Return the estimate minus the label (n,), NaN where either is missing."""
        return self.estimate(name) - self.label(name)

    def where(self, rows: NDArray[np.bool_]) -> "Results":
        """Return the rows where `rows` (n,) is true, with all trials."""
        columns = {
            kind: {name: column[rows] for name, column in getattr(self, kind).items()} for kind in COLUMNS
        }
        return replace(
            self, trial=self.trial[rows], start=self.start[rows], usable=self.usable[rows], **columns
        )


def join(parts: Sequence[Results]) -> Results:
    """Join the results of one estimator in several conditions.

    Columns that a part lacks are NaN in its rows.

    Raises
    ------
    InputError
        If there are no parts, or they differ in estimator, window or hop.

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
    ...     reason_index={},
    ... )
    >>> join([one, one]).trial.tolist()
    [0, 0, 1, 1]
    """
    if not parts:
        raise InputError("no results to join", "one or more")
    first = parts[0]
    for part in parts:
        if (part.estimator, part.window, part.hop) != (first.estimator, first.window, first.hop):
            given = f"results of {part.estimator}, window {part.window:g} s, with {first.estimator}"
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
    columns = getattr(part, kind)
    if kind == "reason_index":
        renumbered = np.array([number[reason] for reason in part.reasons], np.int16)
        return renumbered[columns[name]] if name in columns else np.zeros(len(part), np.int16)
    return columns.get(name, np.full(len(part), np.nan))


def write_results(results: Results, file: Path) -> None:
    """Write results to an ``.npz`` file, which `read_results` reads.

    Examples
    --------
    ``monochord evaluate --out FOLDER`` writes one.
    """
    about = {
        "format": FORMAT,
        "estimator": results.estimator,
        "window": results.window,
        "hop": results.hop,
        "trials": [to_tree(trial) for trial in results.trials],
        "reasons": list(results.reasons),
        "options": dict(results.options),
        "notes": list(results.notes),
    }
    arrays: dict[str, NDArray[Any]] = {name: getattr(results, name) for name in ROWS}
    for kind, prefix in COLUMNS.items():
        arrays |= {f"{prefix}.{name}": column for name, column in getattr(results, kind).items()}
    with replacing(file) as part, part.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, about=np.array(json.dumps(about)), **arrays)


def read_results(file: Path) -> Results:
    """Return results from a file of `write_results`.

    Raises
    ------
    InputError
        If the file is missing, damaged, or of another kind.
    """
    try:
        with file.open("rb") as raw, np.load(raw, allow_pickle=False) as stored:
            return _from_arrays({name: stored[name] for name in stored.files}, file)
    except InputError:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        given = f"results {file} (missing or damaged)"
        raise InputError(given, "a file from monochord evaluate") from error


def _from_arrays(arrays: dict[str, NDArray[Any]], file: Path) -> Results:
    about: dict[str, Any] = json.loads(str(arrays.pop("about")))
    version = about.pop("format")
    if version != FORMAT:
        raise InputError(f"results {file} of format {version}", f"format {FORMAT}", "evaluate again")
    lengths = {len(column) for column in arrays.values()}
    if len(lengths) != 1:
        raise InputError(f"results {file} with columns of {len(lengths)} lengths", "one length")
    columns: dict[str, dict[str, NDArray[Any]]] = {kind: {} for kind in COLUMNS}
    rows: dict[str, Any] = {name: arrays.pop(name) for name in ROWS}
    fields = {prefix: field for field, prefix in COLUMNS.items()}
    for name, column in arrays.items():
        prefix, _, key = name.partition(".")
        columns[fields[prefix]][key] = column
    about["trials"] = tuple(from_tree(Trial, trial) for trial in about["trials"])
    about |= {name: tuple(about[name]) for name in ("reasons", "notes")}
    return Results(**rows, **columns, **about)


def write_csv(results: Results, file: Path) -> None:
    """Write results as text, one row per window; unknown values are empty fields."""
    labels, names = [*results.truth], [*results.value]
    head = ["session", "object", "condition", "start", "usable", *(f"true_{name}" for name in labels)]
    head += [f"{name}{end}" for name in names for end in ("", "_std", "_why_not")]
    with replacing(file) as part, part.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(head)
        for row, number in enumerate(results.trial.tolist()):
            trial = results.trials[number]
            line: list[Any] = [trial.session, trial.object, trial.condition, f"{results.start[row]:.6f}"]
            line += [int(results.usable[row]), *(_text(results.truth[name][row]) for name in labels)]
            for name in names:
                reason = results.reasons[int(results.reason_index[name][row])]
                line += [_text(results.value[name][row]), _text(results.std[name][row]), reason]
            writer.writerow(line)


def _text(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.9g}"
