"""When readings were taken, from the sender's count and the arrival times."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Seconds

STRETCH: Seconds = 60.0
"""Time over which two clocks keep a constant ratio, in s; longer recordings use one line per stretch."""
STEP_WINDOW: Seconds = 2.0
"""The least delay must change over this time before the sender's clock counts as stepped, in s."""
CERTAIN_STEP: Seconds = 1.0
"""A change this large is always a step; a smaller one must last this long on both sides."""
MAX_LOST_RUN = 64
"""A run of this many lost readings is unlikely: a larger jump in the count is a step."""
MIN_STEP: Seconds = 2e-3
"""Smallest step searched in the sender's clock; jitter raises it."""
MAX_MEDIAN_DELAY: Seconds = 0.1
"""Median delay above the line beyond which a count is not proportional to time."""
MIN_SPACING: Seconds = 1e-9
"""Spacing given to readings with equal times."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A run of readings [first, stop) over which the sender's count advanced evenly.

    `rate` is the count's fitted rate in ticks per second of the host's clock; `ppm` is its deviation from the
    nominal rate (NaN where none is given). `jitter_median` and `jitter_p99` are delays relative to the
    fastest reading. Where `steady` is false, the count was unusable and arrival times are used.
    """

    first: int
    stop: int
    rate: float
    ppm: float
    jitter_median: Seconds
    jitter_p99: Seconds
    steady: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingTimes:
    """When each reading was taken: `time` (n,) in seconds of the host's clock, and its pieces.

    Without a count there are no pieces, and `time` is the time of arrival.
    """

    time: Floats
    pieces: tuple[Piece, ...]


def times_taken(arrival: Floats, count: NDArray[np.int64] | None, *, rate: float = 0.0) -> ReadingTimes:
    """Return when readings were taken, from a line under their arrival times (n,) in s.

    A reading with count k was taken at a + k / r and arrived later by a non-negative delay. Of all lines
    below the points (k, arrival), the fit is the one with the least mean distance: the edge of the lower
    convex hull below their mean (Moon, Skelly and Towsley 1999). Jitter and bunched packets lie above the
    line and do not move it; lost packets do not matter. A constant minimum delay cannot be distinguished from
    a late sender's clock; taps measure it.

    Readings are cut into pieces where the count restarted or its clock stepped by more than some
    milliseconds. Long pieces are cut into stretches of a minute, with times interpolated between their
    middles, because clocks drift with temperature.

    `count` (n,) is the sender's count or clock in ticks, in any order; None or negative where it sends none.
    `rate` is its nominal number of ticks a second, 0 where unknown. Times rise strictly with the count in
    each piece, and from piece to piece.

    >>> rng = np.random.default_rng(1)
    >>> count = np.arange(7000)
    >>> arrival = 5.0 + count / 7000.0 + rng.exponential(1e-3, 7000)
    >>> taken = times_taken(arrival, count, rate=7000.0)
    >>> bool(np.abs(taken.time - 5.0 - count / 7000.0).max() < 2e-5)
    True
    """
    if arrival.ndim != 1 or (count is not None and count.shape != arrival.shape):
        raise InputError(
            f"arrivals {arrival.shape} and counts {None if count is None else count.shape}",
            "one count for each arrival",
        )
    if not np.isfinite(arrival).all():
        raise InputError("arrivals that are not finite", "seconds")
    if count is None or arrival.size == 0 or (count < 0).any():
        return ReadingTimes(time=_rising(arrival, np.arange(arrival.size)), pieces=())
    elapsed = (count - count[0]).astype(np.float64)
    sent_rate = _sent_rate(arrival, elapsed, rate)
    time, pieces = np.empty(arrival.size), list[Piece]()
    edges = [0, *_breaks(arrival - elapsed / sent_rate, sent_rate, elapsed), arrival.size]
    for first, stop in pairwise(edges):
        cut = slice(first, stop)
        time[cut], fitted = _fit(arrival[cut], elapsed[cut], sent_rate)
        late = arrival[cut] - time[cut]
        steady = bool(np.median(late) <= MAX_MEDIAN_DELAY)
        if not steady:
            time[cut] = arrival[cut]
        median, high = np.quantile(late, (0.5, 0.99))
        pieces.append(
            Piece(
                first=first,
                stop=stop,
                rate=fitted,
                ppm=1e6 * (fitted / rate - 1.0) if rate > 0.0 else math.nan,
                jitter_median=float(median),
                jitter_p99=float(high),
                steady=steady,
            )
        )
    order = np.concatenate(
        [piece.first + np.argsort(count[piece.first : piece.stop], kind="stable") for piece in pieces]
    )
    return ReadingTimes(time=_rising(time, order), pieces=tuple(pieces))


def _rising(time: Floats, order: NDArray[np.int64]) -> Floats:
    """Return strictly rising times in the given order, with the smallest change."""
    apart = MIN_SPACING * np.arange(order.size)
    risen = np.empty_like(time)
    risen[order] = np.maximum.accumulate(time[order] - apart) + apart
    return risen


def _sent_rate(arrival: Floats, elapsed: Floats, nominal: float) -> float:
    """Return the median rate of the count over stretches of about a second; restarts do not move it."""
    span = float(arrival[-1] - arrival[0])
    step = min(max(math.ceil(arrival.size / max(span, 1e-9)), 1), max(arrival.size // 2, 1))
    over, ticks = arrival[step:] - arrival[:-step], elapsed[step:] - elapsed[:-step]
    runs = (over > 0.0) & (ticks > 0.0)
    if runs.sum() >= 8:
        return float(np.median(ticks[runs] / over[runs]))
    return nominal if nominal > 0.0 else 1.0


def _breaks(residual: Floats, rate: float, elapsed: Floats) -> list[int]:
    """Return where a new piece begins: where the least delay changes."""
    from scipy.ndimage import minimum_filter1d  # noqa: PLC0415

    n = residual.size
    if n < 8:
        return []
    ticks = np.diff(elapsed)
    each = float(np.median(np.abs(ticks)))
    reach, seen = (
        int(max(span * rate / each, 8.0)) if each > 0.0 else 16 for span in (STEP_WINDOW, CERTAIN_STEP)
    )
    before = minimum_filter1d(
        residual, min(reach, n), mode="constant", cval=np.inf, origin=(min(reach, n) - 1) // 2
    )
    after = minimum_filter1d(
        residual, min(reach, n), mode="constant", cval=np.inf, origin=-(min(reach, n) // 2)
    )
    change = after[1:] - before[:-1]
    usual = float(np.median(np.abs(change - np.median(change))))
    # At either end a hold-up of the network looks like a step, if the count goes on.
    threshold = np.full(n - 1, max(MIN_STEP, 12.0 * usual))
    ends = np.ones(n - 1, np.bool_)
    ends[seen : n - seen] = False
    threshold[ends & (ticks > 0.0) & (ticks < MAX_LOST_RUN * each)] = CERTAIN_STEP
    later = np.flatnonzero(change > threshold) + 1
    sooner = np.flatnonzero(residual[1:] < before[:-1] - threshold) + 1
    breaks: list[int] = []
    for place in sorted({*later[np.diff(later, prepend=-2) > 1].tolist(), *sooner.tolist()}):
        # For a while, what comes after a break is still compared with what was before it.
        since = residual[breaks[-1] : place] if breaks else residual[:0]
        level, enough = since.min(initial=np.inf), threshold[place - 1]
        fell, rose = residual[place] < level - enough, after[place] > level + enough
        if not 0 < since.size < reach or fell or rose:
            breaks.append(int(place))
    return breaks


def _fit(arrival: Floats, elapsed: Floats, rate: float) -> tuple[Floats, float]:
    """Return times from lines under the arrivals, one per stretch, and the overall rate."""
    residual = arrival - elapsed / rate
    low, high = float(elapsed.min()), float(elapsed.max())
    # A count that claims far more time than went by is of no use, however many stretches it had.
    span = min((high - low) / rate, 2.0 * float(np.ptp(arrival)) + STRETCH)
    count = max(1, math.floor(span / STRETCH))
    edges = np.linspace(low, high, count + 1)
    middles, heights, slopes = list[float](), list[float](), list[float]()
    for left, right in pairwise(edges):
        inside = (elapsed >= left) & (elapsed <= right)
        if inside.sum() >= 2:
            middle = 0.5 * (left + right)
            height, slope = line_under(elapsed[inside] - middle, residual[inside])
            middles.append(middle)
            heights.append(height)
            slopes.append(slope)
    if not middles:
        return arrival.copy(), rate
    if len(middles) == 1:
        line, slope = heights[0] + slopes[0] * (elapsed - middles[0]), slopes[0]
    else:
        # The outer stretches go on along their own lines.
        ends = (heights[0] + slopes[0] * (low - middles[0]), heights[-1] + slopes[-1] * (high - middles[-1]))
        line = np.interp(elapsed, [low, *middles, high], [ends[0], *heights, ends[1]])
        slope = (heights[-1] - heights[0]) / (middles[-1] - middles[0])
    period = 1.0 / rate + slope
    if period <= 0.0:  # the arrivals run backwards against such a count
        return arrival.copy(), rate
    return elapsed / rate + line, 1.0 / period


BINS = 4000
"""Points are thinned to the lowest of each bin, with this many bins, before the hull is computed."""


def line_under(x: Floats, y: Floats) -> tuple[float, float]:
    """Return the line a + b x below all points (n,) with the least mean distance to them, as a and b.

    Of the lines with a + b x_i <= y_i for all i, it is the highest at the mean of x: the edge of the lower
    convex hull there (Moon, Skelly and Towsley 1999); b is 0 where all x are equal. It takes the time of a
    sort. Of more than some thousand points only the lowest in each bin of x counts, which is exact where the
    line is nearly level: subtract the nominal slope from y first.

    >>> rng = np.random.default_rng(0)
    >>> x = np.linspace(-1.0, 1.0, 500)
    >>> a, b = line_under(x, 0.5 + 1e-3 * x + rng.exponential(1e-3, 500))
    >>> abs(a - 0.5) < 3e-5, abs(b - 1e-3) < 1e-4
    (True, True)
    """
    low, high = float(x.min()), float(x.max())
    if not high > low:
        return float(y.min()), 0.0
    mean = float(x.mean())
    x, y = _lowest_of_bins(x, y, low, high)
    hull = _lower_hull(x, y)
    right = int(np.clip(np.searchsorted(x[hull], mean), 1, len(hull) - 1))
    i, j = hull[right - 1], hull[right]
    slope = float((y[j] - y[i]) / (x[j] - x[i]))
    return float(y[i] - slope * x[i]), slope


def _lowest_of_bins(x: Floats, y: Floats, low: float, high: float) -> tuple[Floats, Floats]:
    """Return the lowest point of each x or bin of x, by rising x."""
    place = x if x.size <= BINS else np.floor((x - low) * (BINS / (high - low)))
    order = np.lexsort((y, place))
    place = place[order]
    lowest = order[np.concatenate([[True], place[1:] > place[:-1]])]
    return x[lowest], y[lowest]


def _lower_hull(x: Floats, y: Floats) -> list[int]:
    """Return which points are corners of the lower convex hull; x must rise (Andrew 1979)."""
    px, py = x.tolist(), y.tolist()
    hull: list[int] = []
    for k in range(len(px)):
        while len(hull) > 1:
            i, j = hull[-2], hull[-1]
            if (py[j] - py[i]) * (px[k] - px[i]) < (py[k] - py[i]) * (px[j] - px[i]):
                break
            hull.pop()
        hull.append(k)
    return hull
