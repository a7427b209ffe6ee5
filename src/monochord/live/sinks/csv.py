"""A table: one row a window, as a spreadsheet or pandas reads it."""

import csv
import json
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from monochord.core.errors import InputError
from monochord.live.sinks._record import NANO, record, unix_nanoseconds
from monochord.live.sinks.base import Run, Sink, Update, Writer

TRUE = ("true_contact", "true_slip", "true_position", "true_force")
"""What a simulated source knows, not all of it in every window."""
TRACKED = (
    "tracked_position", "tracked_position_std", "tracked_force", "tracked_force_std", "decided_contact",
    "decided_slip",
)  # fmt: skip
"""What is followed over time, not all of it from the first window on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Csv(Sink):
    """Write one row of comma-separated values a window.

    The first line names the columns: ``time``, the window's start in seconds since the stream began;
    ``stamp``, when its last sample was at the converter (at hand, where the source does not know) in seconds
    since the Unix epoch, to the nanosecond; then what `jsonl` writes, a reason ``NAME_why_not`` for each
    estimate, and the window's ``events`` as JSON. What is not known is an empty cell. A value that the first
    window did not have a column for stands in the last column, ``more``, as JSON. Every row is with the
    system at once: a program that is killed loses none that it wrote.

    Parameters
    ----------
    path
        The file to write; one that is there is replaced.
    """

    path: str = "live.csv"

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:  # noqa: ARG002
        """Open the file; raises `InputError` where it cannot be written."""
        try:
            file = Path(self.path).open("w", encoding="utf-8", newline="", buffering=1)  # noqa: SIM115
        except OSError as error:
            raise InputError(f"file {self.path} ({error.strerror})", "a path that can be written") from error
        with file:
            yield _Rows(file)


class _Rows(Writer):
    def __init__(self, file: TextIO) -> None:
        self._rows: Any = csv.writer(file, lineterminator="\n")
        self._columns: tuple[str, ...] = ()

    def write(self, update: Update) -> None:
        cells = _cells(update)
        if not self._columns:
            truth = TRUE if update.truth else ()
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
