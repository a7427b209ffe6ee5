"""Levels of sound, its shares of clipped samples and of hum, and its strongest tone's prominence."""

import math

import numpy as np

from monochord.core.clipping import LOUD
from monochord.core.kernels import kernel
from monochord.core.shapes import sound
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, decibels

MAINS: tuple[Hertz, Hertz] = (50.0, 60.0)
HARMONICS = 3
"""Number of mains harmonics that count as hum."""
TONES: tuple[Hertz, Hertz] = (1000.0, 8000.0)
"""Frequency range for tones: every string has partials there, and mains harmonics are weak."""
NEIGHBOURHOOD: Hertz = 400.0
"""Width of the bands whose median is the noise beside a tone, in Hz."""
MIN_LINES = 16
"""Smallest number of lines for a median."""
LOUD_LEVEL = decibels(LOUD)
"""Peak in dB from which a meter says that sound is clipped."""


def levels(channel: Audio) -> tuple[float, float]:
    """Return a channel's level, root mean square and peak, in dB below full scale; NaN stays NaN.

    Examples
    --------
    >>> [round(level, 2) for level in levels(np.array([0.1, -0.1, 0.1, -0.1], np.float32))]
    [-20.0, -20.0]
    """
    with np.errstate(all="ignore"):
        wide = channel.astype(np.float64)
        return decibels(float(np.sqrt(np.mean(wide**2)))), decibels(float(np.max(np.abs(wide))))


def measure_levels(samples: Audio, sample_rate: Hertz) -> Floats:
    """Return each channel's level, share of samples as loud as `LOUD`, and share of hum, (channels, 3).

    The level is the root mean square without the mean. Hum is the power at the mains frequency, 50 or 60 Hz,
    and its first harmonics, by Goertzel's recursion (1958) without a taper, relative to the total power.

    Parameters
    ----------
    samples
        Window (channels, n), in full scale.
    sample_rate
        In Hz.

    Examples
    --------
    >>> time = np.arange(4410) / 44100.0
    >>> hum = (0.1 * np.sin(2.0 * np.pi * 50.0 * time)).astype(np.float32)
    >>> measure_levels(np.stack((hum, 0.0 * hum)), 44100.0).round(2).tolist()
    [[0.07, 0.0, 1.0], [0.0, 0.0, 0.0]]
    """
    return _measured(sound(samples), float(sample_rate))


@kernel()
def _measured(samples: Audio, sample_rate: Hertz) -> Floats:
    count = samples.shape[1]
    measured = np.zeros((samples.shape[0], 3))
    for channel in range(samples.shape[0]):
        mean = 0.0
        for k in range(count):
            mean += samples[channel, k]
        mean /= count
        power, loud = 0.0, 0
        for k in range(count):
            power += (samples[channel, k] - mean) ** 2
            loud += abs(samples[channel, k]) >= LOUD
        loudest = 0.0
        for mains in MAINS:
            total = 0.0
            for harmonic in range(1, HARMONICS + 1):
                turn = 2.0 * np.cos(2.0 * np.pi * mains * harmonic / sample_rate)
                one = two = 0.0
                for k in range(count):
                    one, two = samples[channel, k] - mean + turn * one - two, one
                total += one * one + two * two - turn * one * two
            loudest = max(loudest, total)
        measured[channel, 0] = np.sqrt(power / count)
        measured[channel, 1] = loud / count
        if power > 0.0:
            measured[channel, 2] = 2.0 * loudest / (count * power)
    return measured


def tone_prominence(samples: Audio, sample_rate: Hertz) -> float:
    """Return the power of any channel's strongest tone relative to the noise around it.

    It is the largest line of a Hann-windowed spectrum over the median of the lines around it. White noise
    gives 8 to 60, since a line's power is exponentially distributed. Infinite for a window that is too short.

    Parameters
    ----------
    samples
        Window (channels, n).
    sample_rate
        In Hz.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal((2, 4410)).astype(np.float32)
    >>> tone = np.sin(2.0 * np.pi * 1920.0 * np.arange(4410) / 44100.0).astype(np.float32)
    >>> tone_prominence(noise, 44100.0) < 40.0, tone_prominence(noise + tone, 44100.0) > 300.0
    (True, True)
    """
    samples = sound(samples)
    count = samples.shape[1]
    step = sample_rate / count
    width, first = round(NEIGHBOURHOOD / step), math.ceil(TONES[0] / step)
    bands = int((min(TONES[1], sample_rate / 2.0) - TONES[0]) / step) // max(width, 1)
    if width < MIN_LINES or bands < 1:
        return math.inf
    lines = slice(first, first + bands * width)
    spectrum = np.fft.rfft(samples * np.hanning(count), axis=1)[:, lines]
    power = (np.abs(spectrum) ** 2).reshape(-1, bands, width)
    noise = np.median(power, axis=2, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nan_to_num(power / noise, nan=0.0).max())
