"""A recording of guided touches, and the labelled session that it becomes."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from monochord.capture.recording.from_files import from_files
from monochord.core.files import refuse_existing, replacing
from monochord.core.types import Signal
from monochord.core.units import Metres
from monochord.live.delivery import reason
from monochord.live.recording import Recording
from monochord.live.touch_guide import LabelRow, TouchGuide
from monochord.live.update import Update

COLUMNS = "begin,end,position,force,contact"


def beside(out: Path) -> tuple[Path, Path]:
    """Return the files of a labelled session while it is recorded: the sound, and the table of labels.

    >>> [path.name for path in beside(Path("touches.mcap"))]
    ['touches.recorded.mcap', 'touches.csv']
    """
    return out.with_name(f"{out.stem}.recorded.mcap"), out.with_suffix(".csv")


def table(rows: list[LabelRow]) -> str:
    """Return labels as a table that `from_files` reads; unknown positions and forces are empty cells.

    >>> table([LabelRow(0.0, 1.5, contact=0.0), LabelRow(2.0, 3.2, 0.062, 0.5)]).splitlines()[1:]
    ['0.000,1.500,,,0', '2.000,3.200,0.062,0.5,1']
    """
    cells = (
        (f"{row.begin:.3f}", f"{row.end:.3f}", _cell(row.position), _cell(row.force), f"{row.contact:g}")
        for row in rows
    )
    return "\n".join([COLUMNS, *map(",".join, cells)]) + "\n"


def complete(out: Path, described: Mapping[str, Any]) -> Path:
    """Make the session of the files `beside` it, also after an interruption; return the table's path.

    The recorded sound is removed once the session is complete; the table stays. Raises `InputError` for a
    file that cannot be used, or a session that exists.
    """
    recorded, labels = beside(out)
    from_files(recorded, labels, out, described={"name": out.stem, **described})
    recorded.unlink()
    return labels


class LabelledRecording:
    """Guided touches recorded into a session with labels; the labels so far are always on the disk.

    The session is `out`, ``NAME.mcap``; while recording, there are ``NAME.recorded.mcap`` and ``NAME.csv``.
    `described` are options of its `Description`, such as ``object`` and ``sensor``. Raises `InputError` where
    one of the files exists or cannot be created.
    """

    def __init__(self, out: Path, guide: TouchGuide, signal: Signal, described: Mapping[str, Any]) -> None:
        self.out, self.guide = out, guide
        self._described = described
        recorded, self._table = beside(out)
        for path in (out, recorded, self._table):
            whose = "no touch in it was labelled: " if path == recorded else ""
            refuse_existing(path, f"{whose}remove it, or choose another name")
        self.recording = Recording(recorded, signal)
        self._written: list[LabelRow] = []
        self._closed = False

    def take(self, update: Update) -> None:
        """Record an update, and show it to the guide."""
        self.recording.take(update)
        self.guide.take(update, self.recording.seconds)
        try:
            self._save()
        except OSError as error:
            self.recording.failure = self.recording.failure or reason(error)

    def _save(self) -> None:
        """Write the labels so far, if they have changed."""
        rows = self.guide.rows
        if rows != self._written:
            with replacing(self._table) as part:
                part.write_text(table(rows), encoding="utf-8")
            self._written = rows

    def finish(self) -> bool:
        """End the recording and make the session; return False where no touch is labelled.

        Without a touch nothing is kept. A second call does nothing.
        """
        if not self._closed:
            self._closed = True
            self.recording.close()
            if self.guide.touches:
                self._save()
                complete(self.out, self._described)
            else:
                for path in beside(self.out):
                    path.unlink(missing_ok=True)
        return bool(self.guide.touches)


def length_of(signal: Signal, usual: Metres) -> Metres:
    """Return the string's length in m: the signal's, or else a usual one."""
    return signal.string.length if signal.string else usual


def _cell(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"
