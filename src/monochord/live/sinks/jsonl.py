"""JSON lines: one object a window, to a file or to standard output."""

import json
import math
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from monochord.core.errors import InputError
from monochord.core.types import Prediction, Signal
from monochord.live.sinks.base import Moment, Sink, Writer


@dataclass(frozen=True, slots=True, kw_only=True)
class Jsonl(Sink):
    """Write one JSON object a window.

    Every object has ``time`` (start of the window, in seconds since the stream began), ``frequency``,
    ``position``, ``position_std``, ``valid`` and ``why_not``, the last two of the position. A number that
    is not known is null.

    Parameters
    ----------
    path
        The file to write; ``-`` is standard output.
    everything
        Whether to add the other estimates with their ``_std``, what the source knows to be true as
        ``true_NAME``, the latency, and the stream's counters.
    """

    path: str = "-"
    everything: bool = True

    @property
    def fills_standard_output(self) -> bool:
        """Whether the lines go to standard output."""
        return self.path == "-"

    @contextmanager
    def open(self, signal: Signal) -> Generator[Writer]:  # noqa: ARG002
        """Open the file; raises `InputError` where it cannot be written."""
        if self.path == "-":
            yield _Lines(sys.stdout, everything=self.everything)
            sys.stdout.flush()
            return
        try:
            file = Path(self.path).open("w", encoding="utf-8")  # noqa: SIM115
        except OSError as error:
            raise InputError(f"file {self.path} ({error.strerror})", "a path that can be written") from error
        with file:
            yield _Lines(file, everything=self.everything)


class _Lines(Writer):
    def __init__(self, file: TextIO, *, everything: bool) -> None:
        self._file, self._everything = file, everything
        # A reader at the other end of a pipe wants each line as it comes; a file is written in blocks.
        self._flush = file is sys.stdout

    def write(self, moment: Moment) -> None:
        record = _position(moment.prediction)
        if self._everything:
            record |= _others(moment.prediction) | _context(moment)
        plain = {name: _finite(value) for name, value in record.items()}
        self._file.write(json.dumps(plain, allow_nan=False) + "\n")
        if self._flush:
            self._file.flush()


def _position(prediction: Prediction) -> dict[str, Any]:
    position = prediction.estimate("position")
    return {
        "time": prediction.time,
        "frequency": prediction.estimate("frequency").value,
        "position": position.value,
        "position_std": position.std,
        "valid": position.valid,
        "why_not": position.why_not,
    }


def _others(prediction: Prediction) -> dict[str, Any]:
    record: dict[str, Any] = {}
    for name, estimate in prediction.estimates.items():
        record |= {name: estimate.value, f"{name}_std": estimate.std}
    return record


def _context(moment: Moment) -> dict[str, Any]:
    truth: Mapping[str, float] = moment.truth
    return {f"true_{name}": value for name, value in truth.items()} | {
        "latency": moment.prediction.latency,
        "dropped": moment.health.dropped,
        "gaps": moment.health.gaps,
        "xruns": moment.health.xruns,
        "skipped": moment.skipped,
    }


def _finite(value: Any) -> Any:
    if isinstance(value, (bool, str, int)):
        return value
    return float(value) if math.isfinite(value) else None
