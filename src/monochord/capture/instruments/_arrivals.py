"""From the kernel's stamps of the wall clock to the monotonic clock, whoever sets the wall clock."""

import time

import numpy as np

from monochord.core.clock import clock_offsets
from monochord.core.types import Floats
from monochord.core.units import Seconds

SLACK = 1e-3
"""How far outside its poll an arrival may seem to lie: the clocks are read one after the other."""


class Arrivals:
    """Turns wall-clock stamps into monotonic times, poll after poll.

    What a poll finds came after the last poll and before now, and the offset between the clocks is read at
    both. A stamp that neither offset brings between them was taken by a clock that someone had set; it
    becomes now. Times never go back. So a step of the wall clock costs at most one poll interval of
    accuracy, for the readings of one poll.
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
    """Return `stamps` less the first offset that brings each between `since` and `now`; else `now`."""
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
