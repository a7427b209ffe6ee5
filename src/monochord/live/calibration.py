"""Calibrates an estimator with recordings of known touch position."""

import dataclasses
import statistics

from monochord.core.errors import InputError
from monochord.live.loop import run
from monochord.live.settings import LiveRun
from monochord.live.sinks.base import Listener, Update


def medians(take: LiveRun) -> dict[str, float]:
    """Return the median of each quantity over a take's windows with a frequency.

    The median suppresses a plucked take's onset and decay.

    Raises
    ------
    InputError
        If no window of the take has a frequency.
    KeyboardInterrupt
        If the take is interrupted: an incomplete take is not used.
    """
    estimates = _Estimates()
    if run(dataclasses.replace(take, sinks=(estimates,))).interrupted:
        raise KeyboardInterrupt
    if not estimates.values:
        why = f"no window has a frequency ({estimates.reason or 'shorter than a window'})"
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
