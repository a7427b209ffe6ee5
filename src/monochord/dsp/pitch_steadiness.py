"""Measures whether the partials of a series are steady within a window, as a string's are and a voice's not.

A string keeps its pitch while its partials sound or decay. The window is analysed in two overlapping views,
each a share `VIEW` of it, and every partial is searched in both. Partials of a voice glide and jitter between
the views; those of a series that coincides with other sounds' partials by chance drift apart.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Samples, Seconds
from monochord.dsp.spectrum import Analyser

VIEW = 0.6
"""Length of a view as a share of the window; the remaining share separates their centres."""
PARTIALS = 40
"""Largest number of partials."""
REACH = 0.03
"""Search range around a partial, relative to its frequency."""
MAX_REACH, MIN_REACH = 0.4, 0.8
"""Upper limit of that range relative to f0, and lower limit relative to a view's resolution."""
RANGE = 1.0e-3
"""Smallest power of a partial that counts, relative to the strongest one's."""


class Steadiness(NamedTuple):
    """Change of a series' partials from the first view to the second.

    `glide` is the change of the pitch and `scatter` the spread of the partials about it, both as the change
    of log frequency in 1/s. `missing` is the share of the series without a line in both views. Partials are
    weighted by the fourth root of their power times their number; glide and scatter are weighted medians.
    """

    glide: float
    scatter: float
    missing: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SteadinessMeter:
    """Measures the steadiness of series in windows of one size; not thread-safe, since it reuses its memory.

    Parameters
    ----------
    sample_rate, size
        Sample rate in Hz, and window length in frames.
    top
        Highest analysed frequency, in Hz.

    Examples
    --------
    >>> time = np.arange(4410) / 44100
    >>> def tone(glide):
    ...     phase = 2 * np.pi * 220 * (time + glide * time**2 / 2)
    ...     return np.atleast_2d(sum(np.sin(n * phase) / n for n in range(1, 9)))
    >>> meter = SteadinessMeter(sample_rate=44100, size=4410)
    >>> abs(meter.measure(tone(0.0), 220.0, 0.0).glide) < 1e-3
    True
    >>> round(meter.measure(tone(0.5), 225.0, 0.0).glide, 2)
    0.49
    """

    sample_rate: int
    size: Samples
    top: Hertz = 6000.0
    _analyser: Analyser = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        view = round(VIEW * self.size)
        analyser = Analyser(sample_rate=self.sample_rate, size=view, top=self.top)
        object.__setattr__(self, "_analyser", analyser)

    @property
    def apart(self) -> Seconds:
        """Time between the centres of the views, in s."""
        return (self.size - self._analyser.size) / self.sample_rate

    def measure(self, samples: Floats | Audio, frequency: Hertz, inharmonicity: float) -> Steadiness:
        """Return the steadiness of a series in a window (channels, size)."""
        analyser = self._analyser
        views = samples[:, : analyser.size], samples[:, -analyser.size :]
        powers = [analyser.powers(view.astype(np.float64, order="C")).mean(axis=0) for view in views]
        n = np.arange(1.0, PARTIALS + 1.0)
        partials = frequency * n * np.sqrt(1.0 + inharmonicity * n * n)
        partials = partials[partials < analyser.top]
        change, weight = _changes(powers[0], powers[1], partials, (analyser.spacing, analyser.resolution))
        known = np.isfinite(change)
        if not known.any():
            return Steadiness(np.inf, np.inf, 1.0)
        glide = _median(change[known], weight[known])
        scatter = _median(np.abs(change[known] - glide), weight[known])
        missing = 1.0 - weight[known].sum() / weight.sum()
        return Steadiness(glide / self.apart, scatter / self.apart, missing)


@kernel()
def _changes(
    first: Floats, second: Floats, partials: Floats, grid: tuple[Hertz, Hertz]
) -> tuple[Floats, Floats]:
    """Return the change of each partial's log frequency, NaN for none, and its weight.

    `grid` holds the bin spacing and the resolution in Hz.
    """
    spacing, resolution = grid
    change, power = np.full(partials.size, np.nan), np.zeros(partials.size)
    for k in range(partials.size):
        reach = max(min(MAX_REACH * partials[0], REACH * partials[k]), MIN_REACH * resolution)
        low = max(int((partials[k] - reach) / spacing), 1)
        high = min(int((partials[k] + reach) / spacing) + 1, first.size - 2)
        if high <= low:
            continue
        i, j = low + int(first[low : high + 1].argmax()), low + int(second[low : high + 1].argmax())
        power[k] = np.sqrt(first[i] * second[j])
        if low < i < high and low < j < high:
            change[k] = np.log(_line(second, j) / _line(first, i))
    weight = np.sqrt(np.sqrt(power)) * np.arange(1, partials.size + 1)
    counted = power >= RANGE * power.max()
    return np.where(counted, change, np.nan), np.where(counted, weight, 0.0)


@part()
def _line(power: Floats, k: int) -> float:
    """Return the vertex of the parabola through the logarithms of three bins, in bins."""
    y0, y1, y2 = np.log(power[k - 1]), np.log(power[k]), np.log(power[k + 1])
    bend = y0 - 2.0 * y1 + y2
    return k + (0.5 * (y0 - y2) / bend if bend < 0.0 else 0.0)


def _median(values: Floats, weights: Floats) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])
