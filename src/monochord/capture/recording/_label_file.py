"""A user's own labels, from a CSV file."""

import csv
import math
from pathlib import Path

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Metres, Seconds

KNOWN = ("contact", "position", "force", "slip")
BETWEEN: dict[str, tuple[float, float, str]] = {
    "contact": (0.0, 1.0, "0 or 1"),
    "slip": (0.0, 1.0, "0 or 1"),
    "position": (0.0, 5.0, "0 to 5 m, from pickup 1"),
}
"""What a column may hold; it catches millimetres."""
AFTER: Seconds = 1.0
"""How far labels may reach beyond the end of the audio."""


def read_labels(
    path: Path, seconds: Seconds, length: Metres | None = None
) -> tuple[Floats, dict[str, Floats]]:
    """Return times (n,) and columns (n,) by name; NaN where a cell is empty.

    The first line names the columns: ``time`` in s from the audio's begin, and others, which hold numbers.
    Cells are parted by commas, semicolons or tabs.

    Raises
    ------
    InputError
        With row and column: where the file is no such table, a cell no number or out of its range, a time out
        of the audio's `seconds` or before the one above it, or a position beyond the string's `length`.
    """
    names, rows = _rows(path)
    numbered = ([_number(path, row, *cell) for cell in zip(names, cells, strict=True)] for row, cells in rows)
    cells = np.array([*numbered], dtype=np.float64).reshape(-1, len(names))
    numbers = [row for row, _ in rows]
    time = cells[:, names.index("time")]
    _refuse_times(path, numbers, time, seconds)
    columns = {name: cells[:, place] for place, name in enumerate(names) if name != "time"}
    for name, column in columns.items():
        low, high, allowed = BETWEEN.get(name, (-math.inf, math.inf, ""))
        if name == "position" and length is not None:
            high, allowed = length, f"0 to {length:g} m, the string's length"
        wrong = np.flatnonzero((column < low) | (column > high) | np.isinf(column))
        if len(wrong):
            given = f"file {path} row {numbers[wrong[0]]}, {name} {column[wrong[0]]:g}"
            raise InputError(given, allowed or "a finite number, or nothing where it is not known")
    return time, columns


def _rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the header and the rows that hold something, each with its number in the file."""
    allowed = "a CSV file whose first line names time and what is known"
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            first = file.readline()
            file.seek(0)
            reader = csv.reader(file, delimiter=max(",;\t", key=first.count), strict=True)
            lines = [
                (number, line) for number, line in enumerate(reader, start=1) if any(map(str.strip, line))
            ]
    except OSError as error:
        raise InputError(f"file {path} ({error.strerror})", allowed, "check its name") from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise InputError(f"file {path} ({error})", allowed) from error
    if not lines:
        raise InputError(f"file {path} (empty)", allowed)
    names = [name.strip() for name in lines[0][1]]
    if "time" not in names:
        remedy = "call the column with the times so"
        raise InputError(f"file {path} with columns {', '.join(names)}", "time and others", remedy)
    if len(set(names)) < len(names) or not all(names):
        raise InputError(f"file {path} with columns {', '.join(names)}", "a name of its own for each")
    for number, line in lines[1:]:
        if len(line) != len(names):
            given = f"file {path} row {number} of {len(line)} cells"
            raise InputError(given, f"{len(names)}, as its first line has")
    return names, lines[1:]


def _number(path: Path, row: int, name: str, cell: str) -> float:
    try:
        return float(cell) if cell.strip() else math.nan
    except ValueError:
        allowed = "a number, or nothing where it is not known"
        raise InputError(f"file {path} row {row}, {name} '{cell.strip()}'", allowed) from None


def _refuse_times(path: Path, rows: list[int], time: Floats, seconds: Seconds) -> None:
    wrong = np.flatnonzero(~((time >= 0.0) & (time <= seconds + AFTER)))
    if len(wrong):
        given = f"file {path} row {rows[wrong[0]]}, time {time[wrong[0]]:g}"
        raise InputError(
            given, f"0 to {seconds:g} s, as long as the audio is", "give times in s from its begin"
        )
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back):
        given = f"file {path} row {rows[back[0] + 1]}, time {time[back[0] + 1]:g} after {time[back[0]]:g}"
        raise InputError(given, "times in order", "sort the rows")
