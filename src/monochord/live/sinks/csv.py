"""A table with one row per window, for a spreadsheet or pandas."""

import csv
import json
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from monochord.core.dated import dated_path
from monochord.core.files import new_text, written
from monochord.live.sinks._record import NANO, TRACKED, TRUE, record, unix_nanoseconds
from monochord.live.sinks.base import Run, Sink, Update, Writer


@dataclass(frozen=True, slots=True, kw_only=True)
class Csv(Sink):
    """Write one row of comma-separated values per window.

    The first line names the columns: ``time``, the window's start in seconds since the stream began;
    ``stamp``, when its last sample was at the converter (or became available, where the source does not know)
    in seconds since the Unix epoch, to the nanosecond; then the values of `jsonl`, a reason ``NAME_why_not``
    for each estimate, and the window's ``events`` as JSON. An unknown value is an empty cell. A value without
    a column in the first window goes into the last column, ``more``, as JSON. Every row reaches the system at
    once: a killed program loses none of its rows.

    Parameters
    ----------
    path
        The file to write, a new one; by default named by the date and time.
    """

    path: str = ""

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:  # noqa: ARG002
        """Open the file; raises `InputError` where it exists or cannot be written."""
        path = Path(self.path) if self.path else dated_path("live", ".csv")
        with new_text(path, newline="", buffering=1) as file:
            yield _Rows(file, path)


class _Rows(Writer):
    def __init__(self, file: TextIO, path: Path) -> None:
        self._path = path
        self._rows: Any = csv.writer(file, lineterminator="\n")
        self._columns: tuple[str, ...] = ()

    def write(self, update: Update) -> None:
        with written(self._path):
            self._write(_cells(update), has_truth=bool(update.truth))

    def _write(self, cells: dict[str, Any], *, has_truth: bool) -> None:
        if not self._columns:
            truth = TRUE if has_truth else ()
            self._columns = tuple(dict.fromkeys((*cells, *truth, *TRACKED)))
            self._rows.writerow((*self._columns, "more"))
        row = [cells.pop(name, None) for name in self._columns]
        self._rows.writerow((*row, json.dumps(cells) if cells else None))


def _cells(update: Update) -> dict[str, Any]:
    seconds, nanoseconds = divmod(unix_nanoseconds(update), NANO)
    values = record(update, everything=True)
    del values["why_not"]  # of the position, which has its own below
    reasons = {f"{name}_why_not": each.reason for name, each in update.prediction.estimates.items()}
    events, notes = values.pop("events"), " ".join(values.pop("notes"))
    shown = {"events": json.dumps(events) if events else None, "notes": notes or None}
    stamp = f"{seconds}.{nanoseconds:09}"
    cells = {"time": values.pop("time"), "stamp": stamp, **values, **reasons, **shown}
    return {name: int(cell) if isinstance(cell, bool) else cell for name, cell in cells.items()}
