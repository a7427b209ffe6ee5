"""Detects taps in a force sensor's and a robot's data: short pulses of force, short dips of height."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Metres, Newtons, Seconds

MAX_TAP: Seconds = 0.04
MIN_PAUSE: Seconds = 0.06
BLOCK: Seconds = 0.1
BOUNCE: Seconds = 0.008
"""A dropout of force no longer than this belongs to the same tap, in s."""
CLEAR = 5.0
"""Standard deviations of the noise that count as contact."""
MIN_FORCE: Newtons = 0.02
"""Smallest force that counts as contact, however quiet the sensor, in N."""
SOFT_EDGE = 2.2
"""Standard deviations of the noise that count as contact next to a certain contact."""
BUILD_UP: Seconds = 3e-4
"""Time of the first wave from a touch to an end of the string and back, in s."""
RISING = 1.2
"""The next reading must be this much larger for the slope to count."""
MIN_DIP: Metres = 1e-3
"""Smallest depth of a dip, in m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Taps:
    """Taps in one stream: `begin` and `end` (n,) of each contact in s of the stream's time.

    `spacing` is the time between two readings.
    """

    begin: Floats
    end: Floats
    spacing: Seconds

    @property
    def middle(self) -> Floats:
        """Return the middles of the contacts."""
        return 0.5 * (self.begin + self.end)

    def __len__(self) -> int:
        return self.begin.size


def taps_of_force(time: Floats, force: Floats, *, min_force: Newtons = 0.1) -> Taps:
    """Return the taps in a force (n,) in N: pulses under 40 ms, with 60 ms without contact before and after.

    The zero level comes from the quietest fifth of every ten seconds, so that bias and drift do not matter. A
    tap begins midway between the last reading within the noise and the first one above it, and peaks at
    `min_force` or more. Raises `InputError` where times (n,) in s do not rise.

    >>> time = np.arange(3000) / 1000.0
    >>> force = np.where(np.abs(time % 1.0 - 0.5) < 0.003, 1.0, 0.0)
    >>> taps_of_force(time, force).middle.round(3).tolist()
    [0.5, 1.5, 2.5]
    """
    spacing = _refuse_unordered(time, force)
    size = max(int(BLOCK / spacing), 3) if spacing > 0.0 else 3
    if time.size < 4 * size:
        return Taps(begin=np.zeros(0), end=np.zeros(0), spacing=spacing)
    level, noise = _level(force, size)
    noise = max(noise, MIN_FORCE / CLEAR)
    above = CLEAR * noise
    rest = force - level
    runs = _runs(time, rest > above, BOUNCE)
    edges = [
        (_edge(time, rest, i, -1, noise), _edge(time, rest, j, 1, noise))
        for i, j in _alone(time, runs, MAX_TAP)
        if rest[i : j + 1].max() >= max(min_force, 2.0 * above)
    ]
    begin, end = np.array(edges, dtype=np.float64).reshape(-1, 2).T
    return Taps(begin=begin, end=end, spacing=spacing)


def taps_of_height(time: Floats, height: Floats, *, longest: Seconds = 0.08) -> Taps:
    """Return the taps in a tool's height (n,) in m: dips deeper than 1 mm that last at most 80 ms.

    A dip's time is the centre of its area, which does not depend on when the readings fall. Begin and end are
    both set to it, since the height does not show them. `longest` is the longest time at half depth or lower.
    Raises `InputError` where times (n,) in s do not rise.

    >>> time = np.arange(400) / 200.0
    >>> height = np.minimum(3e-3, 0.2 * np.abs(time - 1.0012))
    >>> taps_of_height(time, height).middle.round(3).tolist()
    [1.001]
    """
    spacing = _refuse_unordered(time, height)
    reach = 1.5 * longest
    if time.size < 8 or time[-1] - time[0] < 2.0 * reach:
        return Taps(begin=np.zeros(0), end=np.zeros(0), spacing=spacing)
    down = dip(time, height)
    runs = _runs(time, down > MIN_DIP, 0.0)
    middles = [
        middle_of_dip(time, down, 0.5 * (time[i] + time[j])) for i, j in runs if time[j] - time[i] < longest
    ]
    middle = np.array(middles, dtype=np.float64)
    middle = middle[np.isfinite(middle)]
    return Taps(begin=middle, end=middle.copy(), spacing=spacing)


def dip(time: Floats, height: Floats) -> Floats:
    """Return how far a tool is below its height 50 ms before and after, (n,) in m.

    Only short dips show: the lower of the two sides counts, so a lasting descent is not a dip.

    >>> time = np.arange(100) / 100.0
    >>> float(dip(time, np.where(time > 0.5, 0.0, 0.1)).max())
    0.0
    """
    sides = [np.interp(time + shift, time, height) for shift in (-0.07, -0.05, 0.05, 0.07)]
    return np.maximum(np.minimum(np.median(sides[:2], axis=0), np.median(sides[2:], axis=0)) - height, 0.0)


def middle_of_dip(time: Floats, down: Floats, near: Seconds, reach: Seconds = 0.05) -> Seconds:
    """Return the centre of a dip's area, as `dip` computes it, near a time; NaN if there is none.

    >>> time = np.arange(100) / 100.0
    >>> down = np.maximum(0.02 - np.abs(time - 0.502), 0.0)
    >>> abs(middle_of_dip(time, down, 0.51) - 0.502) < 1e-3
    True
    """
    around = np.linspace(near - reach, near + reach, 401)
    depth = np.interp(around, time, down, left=0.0, right=0.0)
    depth = np.maximum(depth - 0.2 * depth.max(), 0.0)
    if not (time[0] <= near <= time[-1] and depth.sum() > 0.0):
        return float("nan")
    return float(around @ depth / depth.sum())


def groups_of(taps: Taps, *, apart: Seconds = 2.0, min_taps: int = 2) -> tuple[Taps, ...]:
    """Return groups of `min_taps` or more taps, at most `apart` seconds from one to the next.

    >>> times = np.array([1.0, 1.3, 2.0, 60.0, 60.5])
    >>> [len(group) for group in groups_of(Taps(begin=times, end=times, spacing=1e-3))]
    [3, 2]
    """
    edges = [0, *(np.flatnonzero(np.diff(taps.begin) > apart) + 1).tolist(), len(taps)]
    cuts = [slice(i, j) for i, j in pairwise(edges) if j - i >= min_taps]
    return tuple(Taps(begin=taps.begin[cut], end=taps.end[cut], spacing=taps.spacing) for cut in cuts)


def _refuse_unordered(time: Floats, values: Floats) -> Seconds:
    """Return the median time between readings; raises `InputError` where times do not rise."""
    if time.ndim != 1 or time.shape != values.shape:
        raise InputError(f"times {time.shape} and values {values.shape}", "one value for each time")
    steps = np.diff(time)
    if (steps <= 0.0).any():
        raise InputError("times that do not rise", "readings in order")
    return float(np.median(steps)) if steps.size else 0.0


def _level(force: Floats, size: int) -> tuple[Floats, float]:
    """Return the zero level (n,) and the standard deviation of the noise about it.

    Repeated readings, such as before the sensor starts, show no noise and are left out.
    """
    blocks = force[: force.size // size * size].reshape(-1, size)
    middle = np.median(blocks, axis=1)
    spread = 1.4826 * np.median(np.abs(blocks - middle[:, None]), axis=1)
    wide = round(10.0 / BLOCK)
    far = max(len(middle) // wide, 1)
    parts = np.array_split(np.arange(len(middle)), far)
    quiet = np.array([np.quantile(middle[part], 0.2) for part in parts])
    centre = np.array([size * (part.mean() + 0.5) for part in parts])
    noise = np.quantile(spread[spread > 0.0], 0.3) if spread.any() else 0.0
    return np.interp(np.arange(force.size), centre, quiet), float(noise)


def _runs(time: Floats, on: np.ndarray, gap: Seconds) -> list[tuple[int, int]]:
    """Return first and last index of each stretch that is on; stretches at most `gap` apart are joined."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(np.int8)))
    runs: list[tuple[int, int]] = []
    for first, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if runs and time[first] - time[runs[-1][1]] <= gap:
            runs[-1] = runs[-1][0], stop - 1
        else:
            runs.append((first, stop - 1))
    return runs


def _edge(time: Floats, rest: Floats, inside: int, step: int, noise: Newtons) -> Seconds:
    """Return where a pulse begins (step -1) or ends (1), starting at a reading surely inside it.

    A soft touch begins below the detection threshold; the mean over some 0.3 ms still shows it. Where
    readings are as far apart as that, the line through the first of them is extrapolated to zero force, by at
    most one and a half readings.
    """
    usual = float(time[min(inside + 1, len(time) - 1)] - time[inside - 1]) / 2.0
    many = max(round(BUILD_UP / usual), 1)
    for _ in range(len(rest) if many > 1 else 0):
        beyond = inside + step * np.arange(1, many + 1)
        if beyond[-1] not in range(len(rest)) or rest[beyond].mean() <= SOFT_EDGE * noise / math.sqrt(many):
            break
        inside += step
    beyond = min(max(inside + step, 0), len(time) - 1)
    rising = [inside]
    while many == 1 and len(rising) < 4 and rest[rising[-1] - step] > RISING * rest[rising[-1]]:
        rising.append(rising[-1] - step)
    if len(rising) > 1:
        slope, height = np.polyfit(time[rising] - time[inside], rest[rising], 1)
        back = float(np.clip(height / slope * -step, 0.0, 1.5 * usual))
        return float(time[inside]) + step * back
    return 0.5 * float(time[inside] + time[beyond])


def _alone(time: Floats, runs: list[tuple[int, int]], longest: Seconds) -> list[tuple[int, int]]:
    """Return the complete, short runs with no contact around them."""
    alone: list[tuple[int, int]] = []
    for k, (i, j) in enumerate(runs):
        before = time[runs[k - 1][1]] if k else time[0]
        after = time[runs[k + 1][0]] if k + 1 < len(runs) else time[-1]
        if time[j] - time[i] < longest and time[i] - before >= MIN_PAUSE and after - time[j] >= MIN_PAUSE:
            alone.append((i, j))
    return alone
