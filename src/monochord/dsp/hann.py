"""Lines of a spectrum under a Hann taper, from a transform R that was made without one.

A line's frequency is precise however short the window. For a tone exp((m + i w0) t) and a taper h that is
zero at both ends, integration by parts gives X_h'(w) = -(m + i (w0 - w)) X_h(w), where X_h and X_h' are the
spectra under h and under its derivative. One bin of each gives frequency and growth of a lone tone exactly.
Of a Hann taper both follow from three bins of the plain transform R:
X_h[k] = R[k] / 2 - (R[k-1] + R[k+1]) / 4 and X_h'[k] = pi (R[k-1] - R[k+1]) / (2 i n).

Transforms and powers are (channels, bins), of one window. Kernels in other files call `hann_bin`, `hann_line`
and `is_peak`, which are compiled into them.

Auger and Flandrin (1995), Improving the readability of time-frequency and time-scale representations by the
reassignment method, IEEE Trans. Signal Process. 43, 1068.
"""

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
from monochord.core.types import Floats
from monochord.core.units import Hertz, Samples

LINES = 8
"""Lines of each channel that `strongest_lines` returns, the strongest first."""
MIN_BIN = 1.0e-30
"""Added to a bin that is divided by."""


@part()
def hann_bin(transform: NDArray[np.complex128], channel: int, k: int) -> complex:
    """Return a channel's bin k under a Hann taper; k is neither the first bin nor the last."""
    return 0.5 * transform[channel, k] - 0.25 * (transform[channel, k - 1] + transform[channel, k + 1])


@part()
def hann_line(transform: NDArray[np.complex128], channel: int, k: int, spacing: Hertz) -> tuple[float, float]:
    """Return where a line with its peak at bin k lies, in bins, and the growth of its amplitude in 1/s.

    It lies within one bin of k. Bins are `spacing` apart.
    """
    beside = transform[channel, k - 1] - transform[channel, k + 1]
    ratio = beside / (hann_bin(transform, channel, k) + MIN_BIN)
    return k + min(max(0.25 * ratio.real, -1.0), 1.0), -0.5 * np.pi * spacing * ratio.imag


@part()
def is_peak(power: Floats, channel: int, k: int) -> bool:
    """Return whether a channel's bin k is the highest of the five around it, of equal ones the first."""
    peak = power[channel, k]
    if power[channel, k - 1] >= peak or peak < power[channel, k + 1]:
        return False
    return power[channel, k - 2] < peak and peak >= power[channel, k + 2]


@kernel()
def hann_power(transform: NDArray[np.complex128], size: Samples) -> Floats:
    """Return the power under a Hann taper (channels, bins); a sine of amplitude a has a^2 / 2 at its bin.

    The transform is of `size` frames. The first and the last bin are 0.

    Examples
    --------
    >>> tone = 0.5 * np.sin(2.0 * np.pi * 100.0 * np.arange(4410) / 44100.0)
    >>> hann_power(np.fft.rfft(tone)[np.newaxis], 4410)[0, 9:12].round(3).tolist()
    [0.031, 0.125, 0.031]
    """
    channels, bins = transform.shape
    power = np.zeros((channels, bins))
    for c in range(channels):
        for k in range(1, bins - 1):
            value = hann_bin(transform, c, k)
            power[c, k] = 8.0 / size**2 * (value.real * value.real + value.imag * value.imag)
    return power


@kernel()
def strongest_lines(
    transform: NDArray[np.complex128], power: Floats, spacing: Hertz, lowest: Hertz, highest: Hertz
) -> tuple[Floats, Floats]:
    """Return the strongest lines of each channel, frequency in Hz and power, each (channels, `LINES`).

    Parameters
    ----------
    transform, power
        Transform without a taper and Hann power, (channels, bins).
    spacing
        Distance of two bins in Hz.
    lowest, highest
        Range of the lines in Hz.

    Returns
    -------
    Frequencies and powers, the strongest first; missing lines are 0 in both.

    Examples
    --------
    >>> tone = np.sin(2.0 * np.pi * 1234.5 * np.arange(4410) / 44100.0)
    >>> transform = np.fft.rfft(tone)[np.newaxis]
    >>> frequency, _ = strongest_lines(transform, hann_power(transform, 4410), 10.0, 100.0, 20000.0)
    >>> round(float(frequency[0, 0]), 1)
    1234.5
    """
    channels, bins = power.shape
    frequency, height = np.zeros((channels, LINES)), np.zeros((channels, LINES))
    first, last = max(int(lowest / spacing), 3), min(int(highest / spacing), bins - 3)
    for c in range(channels):
        for k in range(first, last):
            peak = power[c, k]
            if peak <= height[c, LINES - 1] or not is_peak(power, c, k):
                continue
            rank = LINES - 1
            while rank > 0 and height[c, rank - 1] < peak:
                height[c, rank] = height[c, rank - 1]
                frequency[c, rank] = frequency[c, rank - 1]
                rank -= 1
            height[c, rank] = peak
            frequency[c, rank] = hann_line(transform, c, k, spacing)[0] * spacing
    return frequency, height
