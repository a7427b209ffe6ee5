"""Senders' counters: what is missing, what came too late, when the sender began again."""

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds

Counts: TypeAlias = NDArray[np.int64]
Mask: TypeAlias = NDArray[np.bool_]

MAX_STEP = 1 << 30
"""A count that jumps on by more did not lose so many readings: it began again."""


@dataclass(slots=True, kw_only=True)
class Sequence:
    """A sender's count of its readings, carried on when it wraps round and when it begins again.

    The gaps in what `follow` returns are exactly what `missing` counts. A count that goes back while the
    sender's clock goes on is a stream begun anew; the clock tells what was lost. Where the clock goes back
    too, the reading came too late or twice and is left out, as readings stay in the order in which they
    were taken; unless it is back by more than `patience` or the sender was known to be away: then the
    sender was restarted, and only the time of arrival tells, roughly, what was lost.

    Parameters
    ----------
    wraps
        Whether the sender's counters are of 32 bits and wrap round.
    ticks
        Ticks of the sender's clock from one reading to the next; 0 where that is not known.
    rate
        Readings a second; 0 where that is not known.
    patience
        How many ticks the sender's clock may be back for a reading to be late.
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
        """Carry the count on over the next readings.

        Parameters
        ----------
        count, tick
            The sender's own count and clock, (n,).
        time
            When each came, (n,), in s.
        away
            Whether the sender had gone before the first of them.

        Returns
        -------
        numbers, in_order
            The count carried on, (n,), and which readings are in order, (n,).
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
        """Return by how much the count carried on goes on: 0 for a reading that is late."""
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
