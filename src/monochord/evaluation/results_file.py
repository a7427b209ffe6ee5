"""Results on disk: one ``.npz`` of plain arrays, or a table of text.

The ``.npz`` holds ``trial``, ``start`` and ``usable``, then ``truth.NAME``, ``value.NAME``, ``std.NAME``
and ``why.NAME`` for every label and estimate, each (n,), and ``about``, a text of JSON with all else. NumPy
reads it without pickle.
"""

import csv
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.evaluation.results import COLUMNS, Results, Trial

FORMAT = 1
"""Version of the layout on disk."""
ROWS = ("trial", "start", "usable")


def write_results(results: Results, file: Path) -> None:
    """Write results to a file ``.npz``.

    Examples
    --------
    ``monochord evaluate`` writes one, and `read_results` reads it.
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
    held: dict[str, NDArray[Any]] = {name: getattr(results, name) for name in ROWS}
    for kind in COLUMNS:
        held |= {f"{kind}.{name}": column for name, column in getattr(results, kind).items()}
    with file.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, about=np.array(json.dumps(about)), **held)


def read_results(file: Path) -> Results:
    """Return the results that `write_results` wrote.

    Raises
    ------
    InputError
        If the file is absent, damaged, or something else.
    """
    try:
        with file.open("rb") as raw, np.load(raw, allow_pickle=False) as held:
            return _told({name: held[name] for name in held.files}, file)
    except InputError:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        given = f"results {file} (absent or damaged)"
        raise InputError(given, "a file that monochord evaluate wrote") from error


def _told(arrays: dict[str, NDArray[Any]], file: Path) -> Results:
    about: dict[str, Any] = json.loads(str(arrays.pop("about")))
    found = about.pop("format")
    if found != FORMAT:
        raise InputError(f"results {file} of format {found}", f"format {FORMAT}", "evaluate again")
    lengths = {len(column) for column in arrays.values()}
    if len(lengths) != 1:
        raise InputError(f"results {file} with columns of {len(lengths)} lengths", "one length")
    columns: dict[str, dict[str, NDArray[Any]]] = {kind: {} for kind in COLUMNS}
    rows: dict[str, Any] = {name: arrays.pop(name) for name in ROWS}
    for name, column in arrays.items():
        kind, _, key = name.partition(".")
        columns[kind][key] = column
    about["trials"] = tuple(from_tree(Trial, trial) for trial in about["trials"])
    about |= {name: tuple(about[name]) for name in ("reasons", "notes")}
    return Results(**rows, **columns, **about)


def write_csv(results: Results, file: Path) -> None:
    """Write results as text, a row a window; a field is empty where there is nothing."""
    labels, names = [*results.truth], [*results.value]
    head = ["session", "object", "condition", "start", "usable", *(f"true_{name}" for name in labels)]
    head += [f"{name}{end}" for name in names for end in ("", "_std", "_why_not")]
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(head)
        for row, number in enumerate(results.trial.tolist()):
            trial = results.trials[number]
            line: list[Any] = [trial.session, trial.object, trial.condition, f"{results.start[row]:.6f}"]
            line += [int(results.usable[row]), *(_text(results.truth[name][row]) for name in labels)]
            for name in names:
                reason = results.reasons[int(results.why[name][row])]
                line += [_text(results.value[name][row]), _text(results.std[name][row]), reason]
            writer.writerow(line)


def _text(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.9g}"
