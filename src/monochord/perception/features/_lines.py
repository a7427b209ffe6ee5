"""Spectral lines of a short window, each with a precise frequency.

For a tone exp((m + i w0) t) and a taper h that is zero at both ends, integration by parts gives
X_h'(w) = -(m + i (w0 - w)) X_h(w), where X_h and X_h' are the spectra under h and under its derivative. One
bin of each thus tells frequency and growth of a lone tone exactly, however short the window. Of a Hann taper
both follow from three bins of the plain transform R: X_h[k] = R[k] / 2 - (R[k-1] + R[k+1]) / 4 and
X_h'[k] = pi (R[k-1] - R[k+1]) / (2 i n).

Auger and Flandrin (1995), Improving the readability of time-frequency and time-scale representations by the
reassignment method, IEEE Trans. Signal Process. 43, 1068.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Samples

COUNT = 8
"""Lines kept of a channel, the strongest first."""
LOUDEST = 1.0e3
"""Samples beyond this many times full scale count as it."""


@numba.njit(cache=True, error_model="numpy")
def whole(window: Audio) -> Floats:
    """Return the samples of each channel about their mean; those that are not numbers count as zero."""
    told = np.empty(window.shape)
    for c in range(window.shape[0]):
        total = 0.0
        for i in range(window.shape[1]):
            sample = window[c, i] if np.isfinite(window[c, i]) else 0.0
            told[c, i] = min(max(sample, -LOUDEST), LOUDEST)
            total += told[c, i]
        for i in range(window.shape[1]):
            told[c, i] -= total / window.shape[1]
    return told


@numba.njit(cache=True, error_model="numpy")
def powers(plain: NDArray[np.complex128], size: Samples) -> Floats:
    """Return the power under a Hann taper (channels, bins): a sine of amplitude a has a^2 / 2 at its bin.

    `plain` is the transform without a taper (channels, bins) of `size` frames.
    """
    channels, bins = plain.shape
    power = np.zeros((channels, bins))
    for c in range(channels):
        for k in range(1, bins - 1):
            value = 0.5 * plain[c, k] - 0.25 * (plain[c, k - 1] + plain[c, k + 1])
            power[c, k] = 8.0 / size**2 * (value.real * value.real + value.imag * value.imag)
    return power


@numba.njit(cache=True, error_model="numpy")
def strongest(
    plain: NDArray[np.complex128], power: Floats, spacing: Hertz, lowest: Hertz, highest: Hertz
) -> tuple[Floats, Floats]:
    """Return the strongest lines of each channel, frequency in Hz and power, each (channels, COUNT).

    `plain` and `power` are the transform and the Hann power of each channel, (channels, bins), `spacing` the
    distance of two bins. Lines between `lowest` and `highest` are looked at; empty places are 0 in both.
    """
    channels, bins = power.shape
    frequency, height = np.zeros((channels, COUNT)), np.zeros((channels, COUNT))
    first, last = max(int(lowest / spacing), 3), min(int(highest / spacing), bins - 3)
    for c in range(channels):
        for k in range(first, last):
            here = power[c, k]
            beside = max(power[c, k - 2], power[c, k - 1]) >= here or here < max(
                power[c, k + 1], power[c, k + 2]
            )
            if beside or here <= height[c, COUNT - 1]:
                continue
            place = COUNT - 1
            while place > 0 and height[c, place - 1] < here:
                height[c, place] = height[c, place - 1]
                frequency[c, place] = frequency[c, place - 1]
                place -= 1
            value = 0.5 * plain[c, k] - 0.25 * (plain[c, k - 1] + plain[c, k + 1])
            shift = 0.25 * ((plain[c, k - 1] - plain[c, k + 1]) / value).real
            height[c, place] = here
            frequency[c, place] = (k + min(max(shift, -1.0), 1.0)) * spacing
    return frequency, height
