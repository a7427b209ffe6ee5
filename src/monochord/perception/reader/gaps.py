"""Power between the lines: how loud each microphone is there, and how alike both are, in bands.

A touch at rest sustains lines and nothing else; one that slides or rubs is driven at every frequency. A line
covers few bins, so the median of a band's bins is the power between the lines, however loud those are. Of
noise, whose power in a bin is exponentially distributed, the median is log 2 times the mean.
"""

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel
from monochord.core.types import Floats
from monochord.core.units import Hertz
from monochord.dsp.hann import hann_bin

BANDS = 28
"""Bands, of equal ratio."""
EDGES = np.geomspace(20.0, 16000.0, BANDS + 1)
"""Edges of the bands in Hz."""
MIN_BINS, MAX_BINS = 3, 32
"""Fewest bins of a band, of which a narrow one has the nearest; of a wide one, about so many are measured."""
FIRST_BIN = 2
"""Lowest bin; those below hold what removing the mean leaves."""
NOISE_BINS = 1.5
"""Noise bandwidth of a Hann taper in bins."""
MIN_DENSITY = 1.0e-15
"""Least power density in full scale^2 / Hz; rounding to 16 bits has 3.5e-15."""
MIN_SQUARE = 1.0e-30
"""Added to a sum of squares that is divided by."""
COLUMNS = tuple(
    f"gaps {what} band {band}" for what in ("mic 1", "mic 2", "likeness") for band in range(1, BANDS + 1)
)
"""Names of the measures in the order of `measure_gaps`."""


@kernel()
def measure_gaps(transform: NDArray[np.complex128], power: Floats, spacing: Hertz) -> Floats:
    """Return log10 of both microphones' power densities between the lines, and their likeness, (3, `BANDS`).

    Density: the median power of a band's bins, as the mean density of noise in full scale^2 / Hz. Likeness:
    ``sum 2 Re(A B*) / sum (|A|^2 + |B|^2)`` over those of its bins whose power at both is at most the sum of
    both medians; 1 where the microphones are equal, -1 where one is the other upside down, 0 where they are
    independent. Both are the same in windows of any length. A band above half the sample rate is silent.

    Parameters
    ----------
    transform, power
        Transform without a taper and Hann power of both microphones, (2, bins).
    spacing
        Distance of two bins in Hz.
    """
    measured = np.zeros((3, BANDS))
    mean = 1.0 / (np.log(2.0) * NOISE_BINS * spacing)
    for b in range(BANDS):
        first, last = int(np.ceil(EDGES[b] / spacing)), int(np.ceil(EDGES[b + 1] / spacing))
        if last - first < MIN_BINS:
            first = int(np.sqrt(EDGES[b] * EDGES[b + 1]) / spacing + 0.5) - MIN_BINS // 2
        first = max(first, FIRST_BIN)
        last = min(max(last, first + MIN_BINS), power.shape[1] - 1)
        if last - first < MIN_BINS:
            measured[:2, b] = np.log10(MIN_DENSITY)
            continue
        step = max((last - first) // MAX_BINS, 1)
        median_1, median_2 = np.median(power[0, first:last:step]), np.median(power[1, first:last:step])
        measured[0, b] = np.log10(max(median_1 * mean, MIN_DENSITY))
        measured[1, b] = np.log10(max(median_2 * mean, MIN_DENSITY))
        cross, squares = 0.0, MIN_SQUARE
        for k in range(first, last, step):
            if power[0, k] + power[1, k] <= median_1 + median_2:
                one, two = hann_bin(transform, 0, k), hann_bin(transform, 1, k)
                cross += 2.0 * (one.real * two.real + one.imag * two.imag)
                squares += one.real**2 + one.imag**2 + two.real**2 + two.imag**2
        measured[2, b] = cross / squares
    return measured
