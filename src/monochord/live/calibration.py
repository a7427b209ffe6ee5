"""Calibration of an estimator with recordings whose touch position is known."""

import dataclasses
import statistics

from monochord.core.errors import InputError
from monochord.live.loop import run
from monochord.live.settings import LiveRun
from monochord.live.sinks.base import Listener, Update


def medians(take: LiveRun) -> dict[str, float]:
    """Return the median of each quantity over a take's windows that have a frequency.

    The median keeps a plucked take's onset and its dying end from pulling the result.

    Raises
    ------
    InputError
        If no window of the take has a frequency.
    KeyboardInterrupt
        If it is interrupted: half a take is no calibration.
    """
    estimates = _Estimates()
    if run(dataclasses.replace(take, sinks=(estimates,))).interrupted:
        raise KeyboardInterrupt
    if not estimates.values:
        why = f"no window of it has a frequency ({estimates.reason or 'it is shorter than a window'})"
        raise InputError(f"calibration take: {why}", "a take with a clear note", "record it again")
    return {name: statistics.median(values) for name, values in estimates.values.items()}


class _Estimates(Listener):
    def __init__(self) -> None:
        self.values: dict[str, list[float]] = {}
        self.reason = ""

    def write(self, update: Update) -> None:
        frequency = update.prediction.estimate("frequency")
        if not frequency.valid:
            self.reason = frequency.reason
            return
        for name, estimate in update.prediction.estimates.items():
            if estimate.valid:
                self.values.setdefault(name, []).append(estimate.value)
