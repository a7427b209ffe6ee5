"""Converts the kernel's wall-clock stamps to monotonic time, even while the wall clock is being set."""

import time

import numpy as np

from monochord.core.clock import clock_offsets
from monochord.core.types import Floats
from monochord.core.units import Seconds

SLACK = 1e-3
"""Tolerance in s for an arrival outside its poll: the two clocks are read one after the other."""


class Arrivals:
    """Converts wall-clock stamps to monotonic times, poll by poll.

    A reading in a poll arrived after the previous poll and before this one; the offset between the clocks is
    read at both. A stamp that neither offset places in this interval comes from a clock that was set
    meanwhile; it becomes the time of the poll. Times never go back. So a step of the wall clock costs at most
    one poll interval of accuracy, for the readings of one poll.
    """

    def __init__(self) -> None:
        self._offset, self._polled = _now()
        self._last = -np.inf

    def times(self, stamps: Floats) -> Floats:
        """Return the monotonic time (n,) in s of each of the `stamps` (n,) in s of the wall clock, or NaN."""
        offset, now = _now()
        times = convert(stamps, (offset, self._offset), self._polled, now)
        if times.size:
            times = np.maximum.accumulate(np.maximum(times, self._last))
            self._last = float(times[-1])
        self._offset, self._polled = offset, now
        return times


def convert(stamps: Floats, offsets: tuple[Seconds, Seconds], since: Seconds, now: Seconds) -> Floats:
    """Return `stamps` minus the first offset that places each between `since` and `now`; else `now`."""
    times = stamps - offsets[0]
    if times.size and times.min() >= since - SLACK and times.max() <= now + SLACK:  # nearly always
        return np.minimum(times, now)
    times = np.full(stamps.shape, now)
    for offset in reversed(offsets):
        candidate = stamps - offset
        fits = (candidate >= since - SLACK) & (candidate <= now + SLACK)  # false for NaN
        times = np.where(fits, np.minimum(candidate, now), times)
    return times


def _now() -> tuple[Seconds, Seconds]:
    offset = clock_offsets()["realtime"]
    return offset, time.monotonic()
