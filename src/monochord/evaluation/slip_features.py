"""Two plain features of a window that tell sliding from rest, by the physics of both.

A string and its two segments have no partial below the open string's fundamental, and a touch at rest gives
it no force slower than that. Sliding does: friction builds up and gives way, and the surface lifts and
lowers the string. That slow force reaches both ends at once and is heard as a rumble. And between the
partials a string that is held still is silent, while one that is rubbed is shaken at every frequency: the
gaps fill up. Neither feature knows position or force, and nothing in them is fitted to data.
"""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz

LOWEST = 30.0
"""Hz from which a rumble is heard; a preamplifier passes little below."""
HIGH = (4000.0, 15000.0)
"""Hz between which gaps are looked at: many partials, all of them weak."""
SILENCE = 1e-20
"""Power that counts as none."""


def rumble(samples: Audio | Floats, sample_rate: Hertz, open_frequency: Hertz) -> float:
    """Return the level below half the open string's fundamental, in dB of full scale.

    Parameters
    ----------
    samples
        A window, (channels, n), in full scale; the power of the channels is added.
    sample_rate
        In Hz.
    open_frequency
        Of the untouched string, in Hz.

    Raises
    ------
    InputError
        If the window is too short to tell anything below that frequency.

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 200.0 * np.arange(4410) / 44100.0)
    >>> round(rumble(np.array([tone, 0 * tone]), 44100.0, 1000.0), 1)
    -3.0
    """
    frequencies, power = _power(samples, sample_rate)
    low = (frequencies >= LOWEST) & (frequencies < 0.5 * open_frequency)
    if low.sum() < 2:
        given = (
            f"a window of {samples.shape[1] / sample_rate:g} s and an open string of {open_frequency:g} Hz"
        )
        raise InputError(given, "a window of several periods of the open string")
    return float(10.0 * np.log10(power[low].sum() + SILENCE))


def filled_gaps(samples: Audio | Floats, sample_rate: Hertz) -> float:
    """Return how flat the spectrum is from 4 to 15 kHz: its geometric over its arithmetic mean, in dB.

    Parameters
    ----------
    samples
        A window, (channels, n), in full scale; the power of the channels is added.
    sample_rate
        In Hz, more than twice 4 kHz.

    Returns
    -------
    float
        0 dB if all are as strong, -2.5 dB for one channel of white noise, far lower where lines stand out.

    References
    ----------
    Gray and Markel (1974), A spectral-flatness measure for studying the autocorrelation method of linear
    prediction of speech analysis, IEEE Trans. Acoust. Speech Signal Process. 22, 207.

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 6000.0 * np.arange(4410) / 44100.0)
    >>> filled_gaps(np.array([tone]), 44100.0) < -60.0
    True
    """
    frequencies, power = _power(samples, sample_rate)
    high = power[(frequencies >= HIGH[0]) & (frequencies < HIGH[1])] + SILENCE
    if high.size < 2:
        raise InputError(f"sample rate {sample_rate:g} Hz", f"above {2.0 * HIGH[0]:g} Hz")
    return float(10.0 * (np.mean(np.log10(high)) - np.log10(np.mean(high))))


def _power(samples: Audio | Floats, sample_rate: Hertz) -> tuple[Floats, Floats]:
    """Frequencies and the power of each in a Hann window, so scaled that the sum is the mean square."""
    size = samples.shape[1]
    window = np.hanning(size)
    spectrum = np.fft.rfft(samples.astype(np.float64) * window, axis=1)
    power = 2.0 * np.sum(np.abs(spectrum) ** 2, axis=0) / (size * np.sum(window**2))
    return np.arange(power.size) * (sample_rate / size), power
