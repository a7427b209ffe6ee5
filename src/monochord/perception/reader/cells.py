"""The input of the reader's network: levels and prominences of both microphones over log(f / f0).

The axis is relative to the string's own pitch f0, with the stiffness taken out: partial n of a segment that
is the share s of the length lies at log(n / s), whatever the string.
"""

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.types import Audio, Floats
from monochord.perception.reader.prominence import MAX_DECADES

STEP, LOWEST, CELLS = 0.003, 0.3, 1416
"""Width of a cell in log(f / f0), f / f0 at the middle of the first cell, and number of cells: up to 21."""
CHANNELS = 4
"""Inputs in each cell: the levels of both microphones, then their prominences."""
LEVEL_DECADES = 8.0
"""Decades below a microphone's strongest line at which a level is 0."""
_EDGES = LOWEST * np.exp(STEP * (np.arange(CELLS + 1) - 0.5))


@kernel()
def cells_of(
    power: Floats, height: Floats, prominence: Floats, bins_per_pitch: float, bending: float
) -> Audio:
    """Return level and prominence of both microphones in each cell, (`CHANNELS`, `CELLS`), from 0 to 1.

    Parameters
    ----------
    power, prominence
        Spectrum of each microphone and what `prominences` makes of it, (2, bins).
    height
        Powers (2, lines) of the strongest lines, strongest first.
    bins_per_pitch
        Open frequency over the distance of two bins.
    bending
        Inharmonicity B of the string.
    """
    cells = np.zeros((CHANNELS, CELLS), np.float32)
    bins, count = power.shape[1], CELLS
    begin = bins_per_pitch * _EDGES[0] * np.sqrt(1.0 + bending * _EDGES[0] ** 2)
    for j in range(CELLS):
        end = bins_per_pitch * _EDGES[j + 1] * np.sqrt(1.0 + bending * _EDGES[j + 1] ** 2)
        first, last = int(begin), int(end)
        if last + 1 >= bins:
            count = j
            break
        for c in range(2):
            loudest = max(_between(power[c], begin), _between(power[c], end))
            most = max(_between(prominence[c], begin), _between(prominence[c], end))
            for k in range(first + 1, last + 1):
                loudest, most = max(loudest, power[c, k]), max(most, prominence[c, k])
            cells[c, j] = loudest / max(height[c, 0], 1.0e-300)
            cells[2 + c, j] = most / MAX_DECADES
        begin = end
    # Logarithms of single precision take half the time.
    one, zero, least = np.float32(1.0), np.float32(0.0), np.float32(1.0e-12)
    per_level = np.float32(1.0 / (np.log(10.0) * LEVEL_DECADES))
    for c in range(2):
        for j in range(count):
            cells[c, j] = min(max(one + np.log(cells[c, j] + least) * per_level, zero), one)
    return cells


@part()
def _between(values: Floats, at: float) -> float:
    """Return an array's value between two of its indices, by linear interpolation."""
    k = int(at)
    return values[k] + (at - k) * (values[k + 1] - values[k])
