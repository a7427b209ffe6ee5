"""The lines of a window of two microphones: frequency, its standard error, and at which end it is louder.

A line's frequency is that of its phase (reassignment): of a tone under a Hann taper three bins of the plain
transform give it exactly. Auger and Flandrin (1995), IEEE Trans. Signal Process. 43, 1068.
"""

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
from monochord.core.shapes import sound
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz

FREQUENCY, STD, OWN, LEVEL, POWER = range(5)
"""Columns of lines: Hz, its error, share of the power at microphone 1, nepers over the floor, and power."""
MAX_LINES = 48
FLOOR_BINS = 48
"""Bins over which a median is the floor."""
MIN_LEVEL = 2.2
"""Least height of a line over the floor's median, in nepers of power. It is 9 medians, and of 4,000 bins of
noise 8 reach it."""
SAME_LINE = 1.5
"""Bins within which peaks at both microphones are one line."""
BEAT, BLUR = 0.02, 0.55
"""Error of a line in bins: of a strong one, that others beat with, and at no height over the floor."""


@kernel()
def floors(power: Floats) -> Floats:
    """Return the logarithm of the floor of each microphone by block (2, blocks): medians of the power."""
    blocks = power.shape[1] // FLOOR_BINS
    floor = np.empty((2, blocks))
    for c in range(2):
        least = 1e-12 * power[c].max() + 1e-300
        for b in range(blocks):
            floor[c, b] = np.log(np.median(power[c, b * FLOOR_BINS : (b + 1) * FLOOR_BINS]) + least)
    return floor


@part()
def _floor_at(floor: Floats, c: int, k: int) -> float:
    at = min(max((k + 0.5) / FLOOR_BINS - 0.5, 0.0), floor.shape[1] - 1.0)
    b = min(int(at), floor.shape[1] - 2)
    return floor[c, b] + (at - b) * (floor[c, b + 1] - floor[c, b])


@kernel()
def lines_of(
    transform: NDArray[np.complex128], size: int, spacing: Hertz, lowest: Hertz, highest: Hertz
) -> Floats:
    """Return the lines (n, 5) of a window of `size` frames that stand out most, in no order.

    `transform` (2, bins) is without a taper; its bins are `spacing` apart.
    """
    bins = transform.shape[1]
    power = np.zeros((2, bins))
    for c in range(2):
        for k in range(1, bins - 1):
            value = 0.5 * transform[c, k] - 0.25 * (transform[c, k - 1] + transform[c, k + 1])
            power[c, k] = 8.0 / size**2 * (value.real**2 + value.imag**2)
    floor = floors(power)
    lines = np.zeros((MAX_LINES, 5))
    count = 0
    for k in range(max(int(lowest / spacing), 3), min(int(highest / spacing), bins - 3)):
        level, of = _peak(power, floor, k)
        if of < 0:
            continue
        value = 0.5 * transform[of, k] - 0.25 * (transform[of, k - 1] + transform[of, k + 1])
        shift = 0.25 * ((transform[of, k - 1] - transform[of, k + 1]) / value).real
        frequency = (k + min(max(shift, -1.0), 1.0)) * spacing
        if count > 0 and frequency - lines[count - 1, FREQUENCY] < SAME_LINE * spacing:
            if lines[count - 1, LEVEL] >= level:
                continue
            count -= 1
        if count == MAX_LINES:
            faintest = lines[:, LEVEL].argmin()
            if lines[faintest, LEVEL] >= level:
                continue
            lines[faintest:-1] = lines[faintest + 1 :].copy()
            count -= 1
        lines[count, FREQUENCY] = frequency
        lines[count, STD] = spacing * np.hypot(BEAT, BLUR * np.exp(-0.5 * level))
        lines[count, OWN] = power[0, k] / (power[0, k] + power[1, k])
        lines[count, LEVEL] = level
        lines[count, POWER] = power[0, k] + power[1, k]
        count += 1
    return lines[:count]


@part()
def _peak(power: Floats, floor: Floats, k: int) -> tuple[float, int]:
    """Return the height over the floor of a peak at bin k, and the microphone where it is higher, else -1."""
    level, of = MIN_LEVEL, -1
    for c in range(2):
        peak = power[c, k]
        below, above = max(power[c, k - 2], power[c, k - 1]), max(power[c, k + 1], power[c, k + 2])
        height = np.log(peak + 1e-300) - _floor_at(floor, c, k)
        if below < peak and peak >= above and height > level:
            level, of = height, c
    return level, of


def window_lines(samples: Audio, sample_rate: int, lowest: Hertz, highest: Hertz) -> Floats:
    """Return the lines (n, 5) of a window (2, n) between two frequencies, in rising order.

    Raises `InputError` unless there are two channels.

    >>> time = np.arange(4410) / 44100.0
    >>> tones = np.stack([np.sin(2.0 * np.pi * f * time) for f in (2436.2, 1730.7)])
    >>> noise = 1e-4 * np.random.default_rng(0).normal(size=(2, 4410))
    >>> window = np.array([[0.8, 0.2], [0.2, 0.8]]) @ tones + noise
    >>> lines = window_lines(window, 44100, 800.0, 16000.0)
    >>> lines[lines[:, POWER] > 1e-3][:, [FREQUENCY, OWN]].round(2)
    array([[1.7307e+03, 6.0000e-02],
           [2.4362e+03, 9.4000e-01]])
    """
    samples = sound(samples, 2)
    size = samples.shape[1]
    centred = samples - samples.mean(axis=1, keepdims=True)
    return lines_of(np.fft.rfft(centred), size, sample_rate / size, lowest, highest)
