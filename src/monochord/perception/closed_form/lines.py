"""The lines of a window of two microphones: frequency, its standard error, and at which end it is louder."""

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
from monochord.core.shapes import sound
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz
from monochord.dsp.hann import hann_line, is_peak
from monochord.dsp.spectrum import BEAT, BLUR, FLOOR_WIDTH, noise_floor
from monochord.perception.spectrum import spectrum_of

FREQUENCY, STD, OWN, LEVEL, POWER = range(5)
"""Columns of lines: Hz, its error, share of the power at microphone 1, nepers over the floor, and power."""
MAX_LINES = 48
"""Most lines of a window; fainter ones are left out. A touch by plain steel has some 30."""
MIN_LEVEL = 1.8
"""Least height of a line over the noise's mean, in nepers of power; of 4,000 bins of noise 8 reach it."""
SAME_LINE = 1.5
"""Bins within which peaks at both microphones are one line."""


def prominent_lines(samples: Audio, sample_rate: int, lowest: Hertz, highest: Hertz) -> Floats:
    """Return the lines (n, 5) of a window (2, n) between two frequencies, in rising order.

    Raises `InputError` unless there are two channels.

    >>> time = np.arange(4410) / 44100.0
    >>> tones = np.stack([np.sin(2.0 * np.pi * f * time) for f in (2436.2, 1730.7)])
    >>> noise = 1e-4 * np.random.default_rng(0).normal(size=(2, 4410))
    >>> window = np.array([[0.8, 0.2], [0.2, 0.8]]) @ tones + noise
    >>> lines = prominent_lines(window, 44100, 800.0, 16000.0)
    >>> lines[lines[:, POWER] > 1e-3][:, [FREQUENCY, OWN]].round(2)
    array([[1.7307e+03, 6.0000e-02],
           [2.4362e+03, 9.4000e-01]])
    """
    samples = sound(samples, 2)
    spacing = sample_rate / samples.shape[1]
    _, transform, power, *_ = spectrum_of(samples, spacing, lowest, highest)
    block = max(int(FLOOR_WIDTH / spacing), 8)
    floor = np.stack([noise_floor(channel, block) for channel in power])
    return _strongest(transform, power, floor, spacing, lowest, highest)


@kernel()
def _strongest(
    transform: NDArray[np.complex128],
    power: Floats,
    floor: Floats,
    spacing: Hertz,
    lowest: Hertz,
    highest: Hertz,
) -> Floats:
    """Return the lines (n, 5) that stand out most, given transform, power and its floor, each (2, bins)."""
    lines = np.zeros((MAX_LINES, 5))
    count = 0
    for k in range(max(int(lowest / spacing), 3), min(int(highest / spacing), power.shape[1] - 3)):
        level, of = _peak(power, floor, k)
        if of < 0:
            continue
        frequency = hann_line(transform, of, k, spacing)[0] * spacing
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
        lines[count, POWER] = power[0, k] + power[1, k]
        lines[count, OWN] = power[0, k] / lines[count, POWER]
        lines[count, LEVEL] = level
        count += 1
    return lines[:count]


@part()
def _peak(power: Floats, floor: Floats, k: int) -> tuple[float, int]:
    """Return the height over the floor of a peak at bin k, and the microphone where it is higher, else -1."""
    level, of = MIN_LEVEL, -1
    for c in range(2):
        if is_peak(power, c, k) and np.log(power[c, k] / floor[c, k]) > level:
            level, of = np.log(power[c, k] / floor[c, k]), c
    return level, of
