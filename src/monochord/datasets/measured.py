"""Ground truth from a laboratory's wrench and pose: contact, position, force and sliding.

- **contact** from the normal force, smoothed over `smooth` and freed of the sensor's slow drift: it begins
  above `on` and ends below `off`, so that noise around a threshold does not split a touch.
- **force** is that smoothed normal force: the string's vibration and the sensor's noise are averaged away.
- **position** is the tool's x, read between the pose's times.
- **slip_along** and **slip_across** are the tool's speed in x and y, the slope of a line through its places
  of `span`, and **slip** is 1 where the speed is above `moving` during contact. A tool that moves drags the
  string along for a moment before it slides, which a pose cannot see: the first millimetre or so counts as
  sliding.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.labels import LabelTrack
from monochord.core.ranges import Checked
from monochord.core.types import Floats
from monochord.core.units import MetresPerSecond, Newtons, Seconds
from monochord.sessions.tracks import ReadingTrack

Flags = NDArray[np.bool_]
GRID: Seconds = 1e-3
"""Spacing of the labels, in s."""
LONGEST_GAP: Seconds = 0.1
"""Readings further apart than this leave a gap of unknown values, in s."""
DRIFT: Seconds = 2.0
"""Averaging time of the untouched force, to follow the sensor's drift, in s."""
BESIDE: Seconds = 0.05
"""Readings this close to a touch do not count as untouched, in s."""
MIN_UNTOUCHED = 0.1
"""Smallest share of a session assumed to be untouched."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds(Checked):
    """Thresholds of contact and sliding; the module describes how each is used."""

    on: Annotated[Newtons, Meta(gt=0.0)] = 0.05
    off: Annotated[Newtons, Meta(gt=0.0)] = 0.03
    smooth: Annotated[Seconds, Meta(gt=0.0, le=1.0)] = 0.02
    moving: Annotated[MetresPerSecond, Meta(gt=0.0)] = 1.5e-3
    span: Annotated[Seconds, Meta(gt=0.0, le=1.0)] = 0.04

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.off > self.on:
            raise InputError(f"contact on {self.on:g} N, off {self.off:g} N", "off no larger than on")


THRESHOLDS = Thresholds()


def measured_truth(
    wrench: ReadingTrack, pose: ReadingTrack, thresholds: Thresholds = THRESHOLDS
) -> LabelTrack:
    """Return labels from force and pose readings, every millisecond; NaN where readings are missing.

    `wrench` has a column ``fz``, the normal force in N, positive when pressed; `pose`, on the same clock, has
    ``x`` and ``y``, along and across the string in m. Raises `InputError` for a stream without readings.

    The force sensor's bias is its reading without contact: first the tenth percentile of the session, then
    the mean of all untouched readings over two seconds, interpolated during touches.
    """
    for track in (wrench, pose):
        if not track.time.size:
            raise InputError(f"stream '{track.feed.stream}' without readings", "readings")
    first, last = max(wrench.time[0], pose.time[0]), min(wrench.time[-1], pose.time[-1])
    time = np.arange(np.ceil(first / GRID), np.floor(last / GRID) + 1) * GRID
    force = _smoothed(wrench.time, wrench.column("fz"), time, thresholds.smooth)
    force = force - _bias(force, thresholds)
    touched = _hysteresis(force, thresholds)
    along, across = (_slope(pose.time, pose.column(name), time, thresholds.span) for name in ("x", "y"))
    known = _is_near(wrench.time, time) & _is_near(pose.time, time)
    columns = {
        "contact": touched.astype(np.float64),
        "position": np.interp(time, pose.time, pose.column("x")),
        "force": force,
        "slip": (touched & (np.hypot(along, across) > thresholds.moving)).astype(np.float64),
        "slip_along": along,
        "slip_across": across,
    }
    return LabelTrack(
        time=time, columns={name: np.where(known, each, np.nan) for name, each in columns.items()}
    )


def _smoothed(time: Floats, values: Floats, at: Floats, span: Seconds) -> Floats:
    """Return means over `span` around the times `at`, interpolated where there are no readings."""
    low, high = (np.searchsorted(time, at + sign * span / 2.0) for sign in (-1.0, 1.0))
    sums = np.concatenate([[0.0], np.cumsum(values - values.mean())])
    count = high - low
    means = (sums[high] - sums[low]) / np.maximum(count, 1) + values.mean()
    return np.where(count > 0, means, np.interp(at, time, values))


def _bias(force: Floats, thresholds: Thresholds) -> Floats:
    """Return the force sensor's drifting zero (n,)."""
    bias = np.full(force.shape, np.quantile(force, MIN_UNTOUCHED))
    for _ in range(2):
        free = ~_widened(_hysteresis(force - bias, thresholds), round(BESIDE / GRID))
        size = round(DRIFT / GRID)
        total, count = (_summed(each, size) for each in (np.where(free, force, 0.0), free.astype(np.float64)))
        known = np.flatnonzero(count > 0.1 * min(size, force.size))
        if not known.size:
            return bias
        bias = np.interp(np.arange(force.size), known, total[known] / count[known])
    return bias


def _hysteresis(force: Floats, thresholds: Thresholds) -> Flags:
    """Return where (n,) there is contact: from a force above `on` until one below `off`."""
    decided = np.where(force > thresholds.on, 1, np.where(force < thresholds.off, 0, -1))
    latest = np.maximum.accumulate(np.where(decided >= 0, np.arange(force.size), -1))
    return (latest >= 0) & (decided[latest] == 1)


def _widened(touched: Flags, by: int) -> Flags:
    return _summed(touched.astype(np.float64), 2 * by + 1) > 0.5


def _summed(values: Floats, size: int) -> Floats:
    """Return sums over `size` neighbours, fewer at the ends."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    index = np.arange(values.size)
    low, high = index - size // 2, index - size // 2 + size
    return sums[np.clip(high, 0, values.size)] - sums[np.clip(low, 0, values.size)]


def _slope(time: Floats, values: Floats, at: Floats, span: Seconds) -> Floats:
    """Return the slopes (n,) of lines fitted over `span` around the times `at`, in 1/s."""
    half = max(round(0.5 * span / GRID), 1)
    arm = np.arange(-half, half + 1)
    padded = np.pad(np.interp(at, time, values), half, mode="edge")
    return np.convolve(padded, arm[::-1], mode="valid") / (np.sum(arm**2) * GRID)


def _is_near(time: Floats, at: Floats) -> Flags:
    """Return where (n,) there are readings close by on both sides."""
    after = np.clip(np.searchsorted(time, at), 1, max(time.size - 1, 1))
    if time.size < 2:
        return np.abs(at - time[0]) < 0.5 * LONGEST_GAP
    return (time[after] - time[after - 1] <= LONGEST_GAP) & (at >= time[0]) & (at <= time[-1])
