"""Levels of a window, and how much of it is hum of the mains."""

import numba
import numpy as np

from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz

MAINS: tuple[Hertz, Hertz] = (50.0, 60.0)
HARMONICS = 3
"""How many harmonics of the mains count as hum."""


@numba.njit(cache=True, error_model="numpy")
def measure_levels(samples: Audio, sample_rate: Hertz) -> Floats:
    """Return level, peak, share of samples at the peak, and share of hum of each channel, (channels, 4).

    The level is the root mean square without the mean. Hum is the power at the mains' frequency, 50 or
    60 Hz, and its first harmonics, by Goertzel's recursion (1958) under no taper, over all power.

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
    >>> measure_levels(np.stack((hum, 0.0 * hum)), 44100.0).round(2)[:, [0, 1, 3]].tolist()
    [[0.07, 0.1, 1.0], [0.0, 0.0, 0.0]]
    """
    count = samples.shape[1]
    measured = np.zeros((samples.shape[0], 4))
    for channel in range(samples.shape[0]):
        mean = 0.0
        for k in range(count):
            mean += samples[channel, k]
        mean /= count
        power = peak = 0.0
        for k in range(count):
            power += (samples[channel, k] - mean) ** 2
            peak = max(peak, abs(samples[channel, k]))
        extreme = 0
        for k in range(count):
            extreme += abs(samples[channel, k]) >= peak
        loudest = 0.0
        for mains in MAINS:
            own = 0.0
            for harmonic in range(1, HARMONICS + 1):
                turn = 2.0 * np.cos(2.0 * np.pi * mains * harmonic / sample_rate)
                one = two = 0.0
                for k in range(count):
                    one, two = samples[channel, k] - mean + turn * one - two, one
                own += one * one + two * two - turn * one * two
            loudest = max(loudest, own)
        measured[channel, 0] = np.sqrt(power / count)
        measured[channel, 1] = peak
        measured[channel, 2] = extreme / count
        if power > 0.0:
            measured[channel, 3] = 2.0 * loudest / (count * power)
    return measured
