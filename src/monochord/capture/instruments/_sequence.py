"""Senders' counters: missing readings, late readings, and restarts of the sender."""

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds

Counts: TypeAlias = NDArray[np.int64]
Mask: TypeAlias = NDArray[np.bool_]

MAX_STEP = 1 << 30
"""Largest jump of the count that counts as lost readings; a larger jump is a restart."""


@dataclass(slots=True, kw_only=True)
class Sequence:
    """A sender's count of its readings, continued across wrap-around and restarts.

    The gaps in what `follow` returns are exactly what `missing` counts. Where the count goes back while the
    sender's clock advances, the stream has restarted, and the clock gives the number of lost readings. Where
    both go back, the reading is late or a duplicate and is left out, since readings keep the order in which
    they were taken. Where the clock goes back by more than `patience`, or the sender is known to have been
    away, the sender has restarted, and only the time of arrival gives a rough number of lost readings.

    `wraps` marks counters of 32 bits. `ticks` of the sender's clock are between two readings, at `rate`
    readings per second; 0 where unknown. A step back of up to `patience` ticks is a late reading.
    """

    wraps: bool = False
    ticks: float = 0.0
    rate: Hertz = 0.0
    patience: float = 0.0
    missing: int = field(default=0, init=False)
    late: int = field(default=0, init=False)
    restarts: int = field(default=0, init=False)
    _began: bool = field(default=False, init=False)
    _count: int = field(default=0, init=False)
    _tick: int = field(default=0, init=False)
    _number: int = field(default=0, init=False)
    _time: Seconds = field(default=0.0, init=False)

    def follow(self, count: Counts, tick: Counts, time: Floats, *, away: bool = False) -> tuple[Counts, Mask]:
        """Return the continued count (n,) of the next readings, and which of them are in order (n,).

        `count` and `tick` (n,) are the sender's, `time` (n,) is that of arrival, and `away` states that the
        sender was away before the first reading.
        """
        in_order = np.ones(count.size, np.bool_)
        if not count.size:
            return count, in_order
        if not self._began:
            self._began, self._number = True, int(count[0]) - 1
            self._count, self._tick, self._time = self._number, int(tick[0]) - 1, float(time[0])
        step = self._difference(np.diff(count, prepend=self._count))
        if step.min() < 1 or step.max() > MAX_STEP:
            for k in range(count.size):
                step[k] = self._step(int(count[k]), int(tick[k]), float(time[k]), away=away)
                in_order[k] = step[k] > 0
                away = away and not in_order[k]
                if in_order[k]:
                    self._count, self._tick, self._time = int(count[k]), int(tick[k]), float(time[k])
        else:
            self._count, self._tick, self._time = int(count[-1]), int(tick[-1]), float(time[-1])
        numbers = self._number + np.cumsum(step)
        self._number = int(numbers[-1])
        self.missing += int(step.sum()) - int(in_order.sum())
        return numbers, in_order

    def _step(self, count: int, tick: int, time: Seconds, *, away: bool) -> int:
        """Return the increase of the continued count; 0 for a late reading."""
        counted = int(self._difference(np.int64(count - self._count)))
        ticked = int(self._difference(np.int64(tick - self._tick)))
        if 1 <= counted <= MAX_STEP:
            return counted
        if ticked <= 0 and counted <= 0 and not away and -ticked <= self.patience:
            self.late += 1
            return 0
        self.restarts += 1
        by_clock = ticked > 0 and self.ticks > 0.0
        lost = ticked / self.ticks if by_clock else (time - self._time) * self.rate
        return min(max(1, round(lost)), MAX_STEP)  # a clock that jumps did not lose more than a count may

    def _difference(self, difference: NDArray[np.int64] | np.int64) -> NDArray[np.int64]:
        if not self.wraps:
            return np.asarray(difference)
        return np.asarray((difference + (1 << 31)) % (1 << 32) - (1 << 31))
