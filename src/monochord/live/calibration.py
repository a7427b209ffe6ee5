"""Calibration of an estimator by takes of which the touch position is known."""

import dataclasses
import statistics
from collections.abc import Generator
from contextlib import contextmanager

from monochord.errors import InputError
from monochord.live.loop import run
from monochord.live.settings import Session
from monochord.sinks.base import Moment, Sink, Writer
from monochord.types import Signal
from monochord.units import Hertz


def median_frequency(take: Session) -> Hertz:
    """Return the median frequency over a take's windows that have one.

    The median keeps a plucked take's onset and its dying end from pulling the result.

    Raises
    ------
    InputError
        If no window of the take has a frequency.
    """
    frequencies = _Frequencies()
    run(dataclasses.replace(take, sinks=(frequencies,)))
    if not frequencies.seen:
        why = f"no window of it has a frequency ({frequencies.why_not or 'it is shorter than a window'})"
        raise InputError(f"calibration take: {why}", "a take with a clear note", "record it again")
    return statistics.median(frequencies.seen)


class _Frequencies(Sink, Writer):
    def __init__(self) -> None:
        self.seen: list[Hertz] = []
        self.why_not = ""

    @contextmanager
    def open(self, signal: Signal) -> Generator[Writer]:  # noqa: ARG002
        yield self

    def write(self, moment: Moment) -> None:
        frequency = moment.prediction.estimates["frequency"]
        if frequency.valid:
            self.seen.append(frequency.value)
        else:
            self.why_not = frequency.why_not
