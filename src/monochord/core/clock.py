"""Time on the sample clock, and the offsets between the clocks of one machine."""

import time
from dataclasses import dataclass
from fractions import Fraction
from itertools import permutations

from monochord.core.units import Samples, Seconds

RATES = 44100, 48000, 32000, 22050, 88200, 96000
"""Sample rates in Hz that are mistaken for one another."""
RATE_RATIOS = tuple(a / b for a, b in permutations(RATES, 2) if Fraction(a, b).denominator > 12)
"""Ratios of such rates that are not those of small numbers, as between partials of a string."""
RATE_TOLERANCE = 0.012
"""Relative distance of a pitch from where a mistaken rate puts it: strings are not quite in tune."""
MIN_CLOCK_STEP: Seconds = 0.05
"""A clock that steps by more than this against the monotonic clock was set, in s."""


def mistaken_rates(ratio: float) -> tuple[int, int] | None:
    """Return two rates in Hz, of which the first is stated as the second if a pitch is off by a ratio.

    >>> mistaken_rates(0.92), mistaken_rates(0.97)
    ((48000, 44100), None)
    """
    pairs = permutations(RATES, 2)
    return next(((a, b) for a, b in pairs if abs(ratio * a / b - 1.0) < RATE_TOLERANCE), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleClock:
    """Maps a sample index to seconds by one division, so that no error accumulates.

    >>> SampleClock(sample_rate=44100).time(441)
    0.01
    """

    sample_rate: int
    origin: Seconds = 0.0

    def time(self, index: Samples) -> Seconds:
        """Return the time of sample `index` in seconds."""
        return self.origin + index / self.sample_rate

    def index(self, seconds: Seconds) -> Samples:
        """Return the sample index nearest to a time.

        >>> SampleClock(sample_rate=44100).index(0.1)
        4410
        """
        return round((seconds - self.origin) * self.sample_rate)


def clock_offsets() -> dict[str, Seconds]:
    """Return this machine's clocks minus the monotonic clock, each read between two monotonic reads.

    Of three readings, the fastest is used: if the program is interrupted between two reads, the offset is
    wrong by half of the pause.

    ``realtime`` is the wall clock; ``monotonic_raw``, used by JACK, is not slewed by NTP.

    >>> sorted(clock_offsets())
    ['monotonic_raw', 'realtime']
    """

    def offset(clock: int) -> Seconds:
        readings: list[tuple[int, float]] = []
        for _ in range(3):
            before = time.monotonic_ns()
            there = time.clock_gettime_ns(clock)
            after = time.monotonic_ns()
            readings.append((after - before, there - (before + after) / 2))
        return min(readings)[1] * 1e-9

    return {
        "realtime": offset(time.CLOCK_REALTIME),
        "monotonic_raw": offset(getattr(time, "CLOCK_MONOTONIC_RAW", time.CLOCK_MONOTONIC)),
    }
