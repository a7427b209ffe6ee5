"""JSON lines: one object per window, to a file or to standard output."""

import json
import os
import sys
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from monochord.core.files import new_text, written
from monochord.live.sinks._record import record
from monochord.live.sinks.base import Run, Sink, Update, Writer


@dataclass(frozen=True, slots=True, kw_only=True)
class Jsonl(Sink):
    """Write one JSON object per window.

    Every object has ``time`` (start of the window, in seconds since the stream began), ``frequency``,
    ``position``, ``position_std``, ``valid`` and ``why_not``; the last two belong to the position. An unknown
    number is null. With several strings, ``string`` comes first, the name of the window's string.

    Parameters
    ----------
    path
        The file to write; ``-`` is standard output.
    everything
        Whether to add the other estimates with their ``_std``, the source's truth as ``true_NAME``, the
        latency, the stream's counters, and the values over time: the string's ``open_frequency`` in Hz, with
        ``_std`` and ``_deviation``, its relative deviation from the nominal frequency; ``tracked_NAME`` with
        ``_std``, ``decided_NAME``, ``events``, and the keys of the health ``notes``.
    """

    path: str = "-"
    everything: bool = True

    @property
    def fills_standard_output(self) -> bool:
        """Whether the lines go to standard output."""
        return self.path == "-"

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:  # noqa: ARG002
        """Open the file; raises `InputError` where it exists or cannot be written."""
        if self.path == "-":
            with _standard_output() as file:
                yield _Lines(file, Path("standard output"), everything=self.everything, flush=True)
            return
        with new_text(Path(self.path)) as file:
            yield _Lines(file, Path(self.path), everything=self.everything, flush=False)


@contextmanager
def _standard_output() -> Generator[TextIO]:
    """Yield a separate file for standard output, where it has a descriptor.

    A reader that stalls then blocks only this file, not the end of the program.
    """
    sys.stdout.flush()
    try:
        number = os.dup(sys.stdout.fileno())
    except OSError:  # standard output that lies in memory
        yield sys.stdout
        sys.stdout.flush()
        return
    with open(number, "w", encoding="utf-8") as file:  # noqa: PTH123  (a number, not a path)
        yield file


class _Lines(Writer):
    def __init__(self, file: TextIO, path: Path, *, everything: bool, flush: bool) -> None:
        # A reader at the other end of a pipe wants each line as it comes; a file is written in blocks.
        self._file, self._path, self._everything, self._flush = file, path, everything, flush

    def write(self, update: Update) -> None:
        values = record(update, everything=self._everything)
        with written(self._path):
            self._file.write(json.dumps(values, allow_nan=False) + "\n")
            if self._flush:
                self._file.flush()
