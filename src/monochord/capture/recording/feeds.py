"""What an instrument brings: its newest reading, its rate, whether it is silent; in fixed memory."""

from collections.abc import Mapping
from dataclasses import dataclass

from monochord.core.types import Feed, InstrumentHealth, Readings
from monochord.core.units import Seconds

QUIET: Seconds = 0.5
"""An instrument whose next reading is this late is silent."""
UNKNOWN: Seconds = 2.0
"""The same where nobody knows how many readings a second are due."""
DUE = 5
"""A slow instrument is silent when so many readings are overdue."""
RATED: Seconds = 1.0
"""The rate is counted over this long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedNow:
    """One instrument at this moment.

    `values` are its newest reading by column and `rate` the readings a second over the last second. `faulty`
    came with a status that is not 0, of which `status` is the newest. `silent` is for how long nothing has
    come, 0 while it is not late.
    """

    name: str
    feed: Feed
    health: InstrumentHealth
    readings: int = 0
    faulty: int = 0
    status: int = 0
    rate: float = 0.0
    silent: Seconds = 0.0
    values: Mapping[str, float]


class FeedTally:
    """Counts the readings of one open instrument, whose first may come from time `begin` on."""

    def __init__(self, name: str, feed: Feed, begin: Seconds) -> None:
        self._name, self._feed = name, feed
        self._patience = max(QUIET, DUE / feed.rate) if feed.rate > 0.0 else UNKNOWN
        self._readings = self._faulty = self._status = 0
        self._heard = self._rated = begin
        self._rated_at = 0
        self._rate = 0.0
        self._newest: Mapping[str, float] = {}

    def add(self, readings: Readings, now: Seconds) -> None:
        """Take readings, at least one, which came by time `now`."""
        self._readings += len(readings.time)
        wrong = readings.status[readings.status != 0]
        if len(wrong):
            self._faulty += len(wrong)
            self._status = int(wrong[-1])
        self._heard = now
        self._newest = dict(zip(self._feed.columns, readings.values[-1].tolist(), strict=True))

    def look(self, now: Seconds, health: InstrumentHealth) -> FeedNow:
        """Return the instrument as it is."""
        if now - self._rated >= RATED:
            self._rate = (self._readings - self._rated_at) / (now - self._rated)
            self._rated, self._rated_at = now, self._readings
        quiet = now - self._heard
        return FeedNow(
            name=self._name,
            feed=self._feed,
            health=health,
            readings=self._readings,
            faulty=self._faulty,
            status=self._status,
            rate=self._rate,
            silent=quiet if quiet > self._patience else 0.0,
            values=self._newest,
        )
