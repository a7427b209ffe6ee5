"""Collects single readings into arrays, with the sender's count and clock."""

from collections.abc import Sequence as Values
from dataclasses import replace

import numpy as np

from monochord.capture.instruments._sequence import Sequence
from monochord.capture.instruments.base import Connection
from monochord.core.types import Feed, InstrumentHealth, Readings
from monochord.core.units import Hertz, Seconds

NONE = -1
NANOSECONDS = 1e9
LATE = 1e9
"""A sender's clock that goes back by more than this, in ns, means that the sender restarted."""


class ReadingsCollector:
    """Collects readings as they arrive and returns them as arrays; `feed` describes them.

    Where the sender counts its readings, gaps are counted and late readings are left out. Where it does not,
    all are kept, and a stamp older than the previous one counts as out of order.
    """

    def __init__(self, feed: Feed) -> None:
        self.feed = feed
        self._rows: list[Values[float]] = []
        self._times: list[Seconds] = []
        self._ticks: list[int] = []
        self._counts: list[int] = []
        self._sequence = _sequence(feed.rate)
        self._last_time = -np.inf
        self._last_tick = NONE
        self._health = InstrumentHealth()

    @property
    def health(self) -> InstrumentHealth:
        """Counters so far."""
        counted, sequence = self._health, self._sequence
        return replace(
            counted,
            missing=sequence.missing,
            out_of_order=counted.out_of_order + sequence.late,
            reconnects=counted.reconnects + sequence.restarts,
        )

    def add(self, values: Values[float], *, time: Seconds, tick: int = NONE, count: int = NONE) -> None:
        """Add a reading with its monotonic time of arrival, the sender's clock in ns and its count, or -1."""
        self._rows.append(values)
        self._times.append(time)
        self._ticks.append(tick)
        self._counts.append(count)

    def refuse(self, readings: int = 1) -> None:
        """Count unreadable readings."""
        self._health = replace(self._health, faulty=self._health.faulty + readings)

    def returned(self) -> None:
        """Count a sender that returned after an absence."""
        self._health = replace(self._health, reconnects=self._health.reconnects + 1)

    def take(self) -> list[Readings]:
        """Return the readings added since the last call, oldest first."""
        if not self._rows:
            return []
        time = np.maximum.accumulate(np.maximum(np.array(self._times, np.float64), self._last_time))
        values = np.array(self._rows, np.float64)
        tick, count = np.array(self._ticks, np.int64), np.array(self._counts, np.int64)
        self._rows, self._times, self._ticks, self._counts = [], [], [], []
        self._last_time = float(time[-1])
        in_order = np.ones(time.size, np.bool_)
        counted = count >= 0
        if counted.any():
            count[counted], in_order[counted] = self._sequence.follow(
                count[counted], tick[counted], time[counted]
            )
        stamped = tick[~counted & (tick >= 0)]
        back = 0
        if stamped.size:
            back = int(np.count_nonzero(np.diff(stamped, prepend=self._last_tick) < 0))
            self._last_tick = int(stamped[-1])
        readings = int(np.count_nonzero(in_order))
        self._health = replace(
            self._health,
            readings=self._health.readings + readings,
            out_of_order=self._health.out_of_order + back,
        )
        if not readings:
            return []
        return [
            Readings(
                stream=self.feed.stream,
                time=time[in_order],
                values=values[in_order],
                sequence=count[in_order],
                device_time=tick[in_order],
                status=np.zeros(readings, np.uint32),
            )
        ]


class CollectedConnection(Connection):
    """A connection that collects its readings one by one; a class derived from it polls."""

    def __init__(self, feed: Feed) -> None:
        self._collected = ReadingsCollector(feed)

    @property
    def feed(self) -> Feed:
        """Description of the readings."""
        return self._collected.feed

    @property
    def health(self) -> InstrumentHealth:
        """Counters so far."""
        return self._collected.health


def _sequence(rate: Hertz) -> Sequence:
    return Sequence(ticks=NANOSECONDS / rate if rate else 0.0, rate=rate, patience=LATE)
