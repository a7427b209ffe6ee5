"""The partials at the beginning of a pluck: the high ones die within some 10 ms."""

import math

import numpy as np

from monochord.core.types import Audio, Floats, StringParams
from monochord.core.units import Hertz, Seconds
from monochord.dsp.spectrum import vertex
from monochord.physics.theory import inharmonicity, open_frequency, stiff_partials

LOWEST: Hertz = 300.0
"""Lowest frequency of a line that counts as the string's: hum lies below."""
ONSET = 0.4
"""Share of its peak that a tap or pluck first passes: noise and hum of simulated builds stay below 0.25."""
SEARCHED = 0.25
"""Relative range of pitches searched around the design's: what a sensor file may deviate by."""
WINDOW: Seconds = 0.1
"""Length of the analysed window. High partials last some 10 ms, so that its taper is largest at the pluck."""
START: Seconds = 1e-3
"""Time from the pluck to the window's start."""
MAX_PARTIALS = 14
TOP = 0.34
"""Highest frequency of a partial, as a share of the sample rate: what preamplifiers pass."""
STEP_F0 = 5e-4
"""Relative step of the search in f0: half a line's width."""
B_FACTORS = np.geomspace(0.25, 4.0, 33)
"""Searched factors of the design's inharmonicity: half to twice its wire's diameter."""
NEAR = 4e-3
"""Relative distance within which a peak is a partial's; ends that yield move one by up to 2e-3."""
MIN_SALIENCE = 10.0
"""Power of a partial over the noise around it."""


def onset(samples: Audio, sample_rate: int, after: Seconds = 0.0) -> int:
    """Return the first frame of the loudest sound in samples (channels, n), above 300 Hz.

    It is where the sound first passes 0.4 of its peak, not before the time `after`. Hum lies below.

    >>> samples = np.zeros((1, 4410), dtype=np.float32)
    >>> samples[0, 2000:2020] = np.sin(np.arange(20))
    >>> abs(onset(samples, 44100) - 2000) < 5
    True
    """
    size = round(sample_rate / (2.0 * LOWEST)) | 1
    mean = np.lib.stride_tricks.sliding_window_view(samples, size, axis=1).mean(axis=2)
    envelope = np.zeros(samples.shape[1])
    half = size // 2
    envelope[half : half + mean.shape[1]] = np.abs(samples[:, half : half + mean.shape[1]] - mean).max(axis=0)
    envelope[: round(after * sample_rate)] = 0.0
    return int(np.argmax(envelope >= ONSET * envelope.max()))


def pluck_partials(samples: Audio, sample_rate: int, string: StringParams) -> tuple[Floats, Floats]:
    """Return numbers and frequencies in Hz, (partials,) each, of a pluck in samples (channels, n).

    The spectrum of all microphones is compared with f_n = n f0 sqrt(1 + B n^2) on a grid of f0 and B; each
    partial is the peak near where the best has it. The string's pitch may be off its design's by `SEARCHED`.
    """
    first = onset(samples, sample_rate) + round(START * sample_rate)
    size = round(WINDOW * sample_rate)
    window = samples[:, first : first + size].astype(np.float64)
    if window.shape[1] < size:
        return np.zeros(0), np.zeros(0)
    points = 4 * size
    taper = np.hanning(2 * size)[size:]
    power = (np.abs(np.fft.rfft(window * taper, points)) ** 2).sum(axis=0) + 1e-30
    spacing = sample_rate / points
    frequency, b = _searched(np.log(power), spacing, string)
    return _peaks(power, spacing, frequency, b, TOP * sample_rate)


def _searched(logs: Floats, spacing: float, string: StringParams) -> tuple[float, float]:
    """Return f0 and B whose partials stand highest over the spectrum between them."""
    nominal = open_frequency(string)
    grid = nominal * np.exp(np.arange(math.log1p(-SEARCHED), math.log1p(SEARCHED), STEP_F0))
    numbers = np.arange(1, MAX_PARTIALS + 1)
    wide = np.maximum.reduce([np.roll(logs, shift) for shift in (-1, 0, 1)])
    top = logs.size - 2
    best, result = -np.inf, (nominal, inharmonicity(string))
    for factor in B_FACTORS:
        b = factor * inharmonicity(string)
        at = grid[:, None] * numbers * np.sqrt(1.0 + b * numbers**2)
        between = at - 0.5 * grid[:, None]
        height = wide[np.minimum((at / spacing).round().astype(int), top)]
        valley = wide[np.minimum((between / spacing).round().astype(int), top)]
        score = np.clip(height - valley, 0.0, 8.0).sum(axis=1)
        i = int(score.argmax())
        if score[i] > best:
            best, result = float(score[i]), (float(grid[i]), float(b))
    return result


def _peaks(power: Floats, spacing: float, f0: float, b: float, top: float) -> tuple[Floats, Floats]:
    """Return numbers and frequencies of the partials that show a peak near where the series has it."""
    numbers: list[int] = []
    peaks: list[float] = []
    frequencies = np.arange(power.size) * spacing
    for n in range(1, MAX_PARTIALS + 1):
        expected = float(stiff_partials(f0, b, n))
        if expected > top:
            break
        reach = max(NEAR * expected, 2.0 * spacing)
        low, high = int((expected - reach) / spacing), int((expected + reach) / spacing) + 2
        around = (frequencies > expected - 0.4 * f0) & (frequencies < expected + 0.4 * f0)
        k = low + int(power[low:high].argmax())
        if not low < k < high - 1 or power[k] < MIN_SALIENCE * np.median(power[around]):
            continue
        numbers.append(n)
        peaks.append((k + vertex(*np.log(power[k - 1 : k + 2]))) * spacing)
    return np.array(numbers), np.array(peaks)
