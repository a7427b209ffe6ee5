"""Reads a table of labels: a row for each instant, or for each touch."""

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NoReturn, TextIO

import numpy as np

from monochord.core.errors import InputError, closest
from monochord.core.files import refuse_endless, similar_name, without_index
from monochord.core.labels import TOUCH_COLUMNS
from monochord.core.types import Floats, StringParams
from monochord.core.units import Seconds
from monochord.physics.known_touches import why_impossible

LABELS = {"contact": "0 or 1", "position": "in m from pickup 1", "force": "in N", "slip": "0 or 1"}
"""Labels that a table may have, with the unit or the values of their columns."""
KNOWN_LABELS = (*LABELS, *TOUCH_COLUMNS, "contacts", "settled")
"""These, and the further ones of simulated sessions."""
YES_OR_NO = "contact", "slip"
"""Labels that are 0 or 1."""
MAX_OVERHANG: Seconds = 1.0
"""Longest time by which labels may exceed the audio."""
TOUCH = ("begin", "end")
"""Columns of a table with one row per touch, in place of `time`."""
TIMES = ("time", *TOUCH)
TOUCH_STEP: Seconds = 0.01
"""Time between the labels that such a row becomes, in s."""
LIKENESS, SHORTEST_NAME = 0.8, 3
"""Least likeness of a misspelt column to the name meant, and fewest letters of an abbreviated one.

Less would refuse columns in their own right, such as ``motion`` or ``source``.
"""
_UNIT = re.compile(
    r"(?<![\s_./-])([\s_./-]*[(\[].*|[\s_./-]+(in[\s_])?"
    r"([mcuk]?[mngs]|(milli|centi|kilo)?(met(re|er)|newton|gram)s?|k?gf|in|inch(es)?|lbf?|pounds?)$)"
)
"""The unit after a column's name: ``position (m)``, ``force_g``, ``position in mm``."""
_SEPARATOR = re.compile(r"sep=([,;\t|])\s*")
"""A first line by which Excel names the separator of cells."""


def read_labels(
    path: Path, seconds: Seconds, string: StringParams | None = None
) -> tuple[Floats, dict[str, Floats]]:
    """Return times (n,) and columns (n,) by name; NaN where a cell is empty.

    The first line names the columns: ``time`` in s from the audio's beginning, and others, all numbers. Cells
    are separated by commas, semicolons or tabs. A table of touches, with ``begin`` and ``end``, is returned
    as labels every `TOUCH_STEP`.

    Raises `InputError`, which names the row and column, if the file is not such a table, a column's name is
    nearly that of a label, a cell is not a number or out of range, a time is beyond the audio's `seconds` or
    before the previous one, a touch is too short for a label, or a position or force is impossible on the
    `string` (see `physics.known_touches`).
    """
    names, rows = _rows(path)
    table = ([_number(path, row, *cell) for cell in zip(names, cells, strict=True)] for row, cells in rows)
    cells = np.array([*table], dtype=np.float64).reshape(-1, len(names))
    numbers = [row for row, _ in rows]
    by_touch = "time" not in names
    when = TOUCH if by_touch else ("time",)
    times = cells[:, [names.index(name) for name in when]]
    columns = {name: cells[:, place] for place, name in enumerate(names) if name not in when}
    _refuse_times(path, numbers, times, when, seconds)
    _refuse_values(path, numbers, columns)
    contact = columns.get("contact", np.ones(len(numbers)))
    if by_touch:
        _refuse_unordered(path, numbers, times)
        _refuse_unlabelled(path, numbers, times, contact, seconds)
    unknown = np.full(len(numbers), np.nan)
    position, force = columns.get("position", unknown), columns.get("force", unknown)
    if not by_touch:
        force = _pressing(force, contact)
    wrong = why_impossible(position, force, string)
    if wrong is not None:
        row = "" if wrong.touch is None else f" row {numbers[wrong.touch]}"
        raise InputError(f"file {path}{row}, {wrong.given}", wrong.expected, wrong.remedy)
    return _of_touches(times, columns, seconds) if by_touch else (times[:, 0], columns)


def _pressing(force: Floats, contact: Floats) -> Floats:
    """Return the forces (n,) of touches, NaN elsewhere, without the force sensor's noise about zero.

    Forces that are negative on average are kept: they are not noise.
    """
    known = np.isfinite(force) & (contact != 0.0) & (force != 0.0)
    noise = force[known].sum() >= -0.5 * np.abs(force[known]).sum()
    return np.where(known & ((force > 0.0) | (not noise)), force, np.nan)


def _of_touches(
    touches: Floats, columns: Mapping[str, Floats], seconds: Seconds
) -> tuple[Floats, dict[str, Floats]]:
    """Return times and columns of touches from begin to end (n, 2)."""
    time = _label_times(seconds)
    touch = np.searchsorted(touches[:, 0], time, side="right") - 1
    contact = (touch >= 0) & (time < np.concatenate((touches[:, 1], [0.0]))[touch])
    labels = {
        name: np.where(contact, np.append(each, np.nan)[touch], np.nan) for name, each in columns.items()
    }
    return time, {"contact": contact.astype(np.float64), **labels}


def _label_times(seconds: Seconds) -> Floats:
    """Return the times in s of the labels (n,) that touches become."""
    return np.arange(0.0, seconds, TOUCH_STEP)


def _rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the header and the nonempty rows, each with its number in the file."""
    allowed = "a CSV file whose first line names time and labels"
    refuse_endless(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            separator, before = _separator(file)
            reader = csv.reader(file, delimiter=separator, strict=True)
            lines = [
                (number, line)
                for number, line in enumerate(reader, start=1 + before)
                if any(map(str.strip, line))
            ]
    except OSError as error:
        remedy = similar_name(path) or "check its name"
        raise InputError(f"file {path} ({error.strerror})", allowed, remedy) from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise InputError(f"file {path} ({error})", allowed) from error
    if not lines:
        raise InputError(f"file {path} (empty)", allowed)
    cells = without_index([line for _, line in lines])
    names = [_name(cell.strip()) for cell in cells[0]]
    _refuse_names(path, names)
    rows = [(number, line) for (number, _), line in zip(lines[1:], cells[1:], strict=True)]
    for number, line in rows:
        if len(line) != len(names):
            given = f"file {path} row {number} of {len(line)} cells"
            commas = separator == "," and len(line) > len(names) and all(map(str.strip, line))
            remedy = "are these decimal commas? Write decimal points" if commas else ""
            raise InputError(given, f"{len(names)}, as in its first line", remedy)
    return names, rows if separator == "," else _with_points(rows)


def _separator(file: TextIO) -> tuple[str, int]:
    """Return the separator of cells, and how many lines are read: that by which Excel names it, or none."""
    first = file.readline()
    if stated := _SEPARATOR.fullmatch(first):
        return stated[1], 1
    file.seek(0)
    return max(",;\t", key=first.count), 0


def _with_points(rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Return rows whose decimal commas are points, unless a cell has a point already."""
    if any("." in cell for _, line in rows for cell in line):
        return rows
    return [(number, [cell.replace(",", ".") for cell in line]) for number, line in rows]


def _name(name: str) -> str:
    """Return a column's name, in lower case where it is a known one."""
    return name.lower() if name.lower() in (*TIMES, *KNOWN_LABELS) else name


def _refuse_names(path: Path, names: Sequence[str]) -> None:
    """Raise `InputError` for a header without times, or with a name that is double, empty or misspelt."""
    given = f"file {path} with columns {', '.join(names)}"
    if "time" not in names and not {*TOUCH} <= {*names}:
        meant = next(filter(None, (_meant(name, TIMES) for name in names if name not in TIMES)), None)
        remedy = "name the time column 'time', or those of each touch 'begin' and 'end'"
        remedy = f"did you mean '{meant}', in s?" if meant else remedy
        raise InputError(given, "time, or begin and end, and labels", remedy)
    if len(set(names)) < len(names) or not all(names):
        raise InputError(given, "a different name for each")
    for name in names:
        meant = None if name in (*TIMES, *KNOWN_LABELS) else _meant(name, LABELS)
        if meant and meant not in names:
            allowed = f"{', '.join(LABELS)}, or a name unlike these"
            remedy = f"did you mean '{meant}', {LABELS[meant]}?"
            raise InputError(f"file {path}, column '{name}'", allowed, remedy)


def _meant(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that a column's name is short for, or misspelt, with or without a unit.

    >>> [_meant(name, LABELS) for name in ("position (m)", "pos", "Foce_g", "temperature")]
    ['position', 'position', 'force', None]
    """
    word = _UNIT.sub("", name.lower())
    short = [each for each in known if each.startswith(word) and len(word) >= SHORTEST_NAME]
    return short[0] if short else closest(word, known, LIKENESS)


def _number(path: Path, row: int, name: str, cell: str) -> float:
    try:
        return float(cell) if cell.strip() else math.nan
    except ValueError:
        allowed = "a number, or an empty cell"
        remedy = "write a decimal point" if "," in cell else ""
        raise InputError(f"file {path} row {row}, {name} '{cell.strip()}'", allowed, remedy) from None


def _refuse_times(
    path: Path, rows: Sequence[int], times: Floats, names: Sequence[str], seconds: Seconds
) -> None:
    """Raise `InputError` for times (n, columns) in s that are beyond the audio, or rows out of order."""
    beyond = np.argwhere(~((times >= 0.0) & (times <= seconds + MAX_OVERHANG)))
    if len(beyond):
        row, column = beyond[0]
        _refuse_beyond(f"file {path} row {rows[row]}, {names[column]} {times[row, column]:g}", seconds)
    first = times[:, 0]
    back = np.flatnonzero(np.diff(first) < 0.0)
    if len(back):
        row = back[0] + 1
        given = f"file {path} row {rows[row]}, {names[0]} {first[row]:g} after {first[row - 1]:g}"
        raise InputError(given, "times in order", "sort the rows")


def _refuse_beyond(given: str, seconds: Seconds) -> NoReturn:
    raise InputError(
        given, f"0 to {seconds:g} s, the length of the audio", "give times in s from its beginning"
    )


def _refuse_unordered(path: Path, rows: Sequence[int], touches: Floats) -> None:
    """Raise `InputError` for touches (n, 2) that end before they begin, or after the next one begins."""
    begin, end = touches.T
    wrong = np.flatnonzero(end < begin)
    if len(wrong):
        row = wrong[0]
        given = f"file {path} row {rows[row]}, end {end[row]:g} before begin {begin[row]:g}"
        raise InputError(given, "begin before end", "are they swapped?")
    wrong = np.flatnonzero(begin[1:] < end[:-1])
    if len(wrong):
        row = wrong[0] + 1
        given = f"file {path} row {rows[row]}, begin {begin[row]:g} before the end {end[row - 1]:g}"
        given += f" of row {rows[row - 1]}"
        raise InputError(given, "one touch at a time", "let each touch end before the next one begins")


def _refuse_unlabelled(
    path: Path, rows: Sequence[int], touches: Floats, contact: Floats, seconds: Seconds
) -> None:
    """Raise `InputError` for touches (n, 2) that would get no label: none of its times is within."""
    time = _label_times(seconds)
    first, stop = np.searchsorted(time, touches).T
    wrong = np.flatnonzero((first == stop) & (contact == 1.0))
    if len(wrong):
        row = wrong[0]
        begin, end = touches[row]
        given = f"file {path} row {rows[row]}, begin {begin:g}"
        if first[row] == time.size:
            _refuse_beyond(given, seconds)
        remedy = "correct its times, or delete the row"
        raise InputError(f"{given}, end {end:g}", f"a touch of {TOUCH_STEP:g} s or longer", remedy)


def _refuse_values(path: Path, rows: Sequence[int], columns: Mapping[str, Floats]) -> None:
    """Raise `InputError` for an infinite value, or one other than 0 and 1 where only these make sense."""
    for name, column in columns.items():
        wrong = np.isinf(column)
        if name in YES_OR_NO:
            wrong = ~(np.isnan(column) | (column == 0.0) | (column == 1.0))
        if wrong.any():
            row = int(wrong.argmax())
            given = f"file {path} row {rows[row]}, {name} {column[row]:g}"
            allowed = LABELS[name] if name in YES_OR_NO else "a finite number"
            raise InputError(given, f"{allowed}, or an empty cell")
