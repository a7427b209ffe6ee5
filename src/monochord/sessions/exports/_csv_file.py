"""Tables as CSV files, each number in as many digits as it takes to read it again bit for bit."""

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.sessions.exports._contents import Columns


def write_csv(path: Path, columns: Columns) -> Path:
    """Write a table; NaN is an empty cell. Where a column is text, all that is no number is quoted."""
    texts = any(column.dtype.kind == "O" for column in columns.values())
    # Else a carriage return in a text would end its row.
    quoting = csv.QUOTE_NONNUMERIC if texts else csv.QUOTE_MINIMAL
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n", quoting=quoting)
        writer.writerow(columns)
        cells = (_cells(column) for column in columns.values())
        writer.writerows(zip(*cells, strict=True))
    return path


def _cells(column: np.ndarray[Any, np.dtype[Any]]) -> list[Any]:
    if column.dtype.kind != "f":
        return column.tolist()
    return [None if math.isnan(value) else value for value in column.tolist()]


def read_csv(path: Path, kinds: Mapping[str, type]) -> Columns:
    """Read a table; columns are float64 but for those that `kinds` names.

    Raises
    ------
    InputError
        If the file cannot be read, a row has another length, or a cell is not of its kind: with its row.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            reader = csv.reader(file, strict=True)
            names = next(reader, [])
            rows = list(reader)
    except OSError as error:
        raise InputError(f"file {path} ({error.strerror})", "a CSV file", "check its name") from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise InputError(f"file {path} ({error})", "CSV in UTF-8") from error
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"file {path} with two columns '{twice}'", "a name of its own for each")
    for number, row in enumerate(rows, start=2):
        if len(row) != len(names):
            raise InputError(f"file {path} row {number} of {len(row)} cells", f"{len(names)}, as its header")
    return {
        name: _column(path, name, [row[place] for row in rows], kinds.get(name, float))
        for place, name in enumerate(names)
    }


def _column(path: Path, name: str, cells: list[str], kind: type) -> np.ndarray[Any, np.dtype[Any]]:
    if kind is str:
        return np.array(cells, dtype=object)
    number = int if issubclass(kind, np.integer) else float
    values: list[float] = []
    for row, cell in enumerate(cells, start=2):
        try:
            values.append(number(cell) if cell or number is int else math.nan)
        except ValueError:
            allowed = "a whole number" if number is int else "a number, or nothing where it is not known"
            raise InputError(f"file {path} row {row}, {name} '{cell}'", allowed) from None
    try:
        return np.array(values, dtype=kind)
    except OverflowError:
        bounds = np.iinfo(kind)
        row, wrong = next((n, v) for n, v in enumerate(values, start=2) if not bounds.min <= v <= bounds.max)
        given = f"file {path} row {row}, {name} {wrong}"
        raise InputError(given, f"a whole number, {bounds.min} to {bounds.max}") from None
