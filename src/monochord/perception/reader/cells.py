"""The input of the reader's network: levels and prominences of both microphones over log(f / f0).

The axis is relative to the string's own pitch f0, with the stiffness taken out: partial n of a segment that
is the share s of the length lies at log(n / s), whatever the string. The prominence of a bin says how far it
stands out of the floor between the lines.

Every window has both computed before anything is known of it, so it is quick: all medians are found at once,
by a sorting network, and of the bins that noise reaches no logarithm is taken.
"""

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
from monochord.core.types import Audio, Floats
from monochord.perception.spectrum import Spectrum, SpectrumAnalyser

STEP, LOWEST, CELLS = 0.003, 0.3, 1416
"""Width of a cell in log(f / f0), f / f0 at the middle of the first cell, and number of cells: up to 21."""
CHANNELS = 4
"""Inputs in each cell: the levels of both microphones, then their prominences."""
LEVEL_DECADES = 8.0
"""Decades below a microphone's strongest line at which a level is 0."""
FLOOR_BINS, FLOOR_DECADES, MAX_DECADES = 24, 0.7, 4.0
"""Bins over which a median is the floor; decades above it that noise reaches, and that count at most."""
_EDGES = LOWEST * np.exp(STEP * (np.arange(CELLS + 1) - 0.5))


def _median_network(size: int) -> NDArray[np.int64]:
    """Return the pairs (n, 2) that Batcher's odd-even mergesort (1968) compares, as far as medians need them.

    `size` is even. After them the values at size / 2 - 1 and size / 2 are those in the middle.
    """
    pairs: list[tuple[int, int]] = []
    merged = 1
    while merged < size:
        apart = merged
        while apart:
            first = (
                at for start in range(apart % merged, size, 2 * apart) for at in range(start, start + apart)
            )
            both = ((low, low + apart) for low in first if low + apart < size)
            pairs += [pair for pair in both if pair[0] // (2 * merged) == pair[1] // (2 * merged)]
            apart //= 2
        merged *= 2
    needed, kept = {size // 2 - 1, size // 2}, list[tuple[int, int]]()
    for pair in reversed(pairs):
        if needed & {*pair}:
            needed |= {*pair}
            kept.append(pair)
    return np.array(kept[::-1])


_NETWORK = _median_network(FLOOR_BINS)


def spectrum_cells(analyser: SpectrumAnalyser, spectrum: Spectrum) -> Audio:
    """Return the network's input for the spectrum of a window, (`cells.CHANNELS`, `cells.CELLS`)."""
    above = prominences(spectrum.power, spectrum.height)
    bins_per_pitch = analyser.nominal / analyser.bin_spacing
    return cells_of(spectrum.power, spectrum.height, above, bins_per_pitch, analyser.bending)


@kernel()
def cells_of(
    power: Floats, height: Floats, prominence: Floats, bins_per_pitch: float, bending: float
) -> Audio:
    """Return level and prominence of both microphones in each cell, (`CHANNELS`, `CELLS`), from 0 to 1.

    `power` (2, bins) and its `prominence` are those of `prominences`, as is `height`. `bins_per_pitch` is the
    open frequency over the distance of two bins, and `bending` the string's inharmonicity B.
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


@kernel()
def prominences(power: Floats, height: Floats) -> Floats:
    """Return by how many decades each bin of `power` stands out of the floor, a median beside it, (2, bins).

    `height` (2, lines) are the powers of the strongest lines, strongest first; 120 dB below is the least
    floor.
    """
    bins = power.shape[1]
    blocks = bins // FLOOR_BINS
    prominence = np.zeros(power.shape)
    below, above = _middle_powers(power)
    for c in range(2):
        least = 1.0e-12 * height[c, 0]
        reach = 10.0**FLOOR_DECADES * np.sqrt((below[c] + least) * (above[c] + least))
        for b in range(-1, blocks):  # from the middle of a block to the middle of the next
            level, next_level = reach[max(b, 0)], reach[min(b + 1, blocks - 1)]
            growth = np.exp(np.log(next_level / level) / FLOOR_BINS)
            first, end = b * FLOOR_BINS + FLOOR_BINS // 2, (b + 1) * FLOOR_BINS + FLOOR_BINS // 2
            for k in range(max(first, 0), end if b < blocks - 1 else bins):
                if power[c, k] + least > level:
                    decades = np.log((power[c, k] + least) / level) / np.log(10.0)
                    prominence[c, k] = min(decades, MAX_DECADES)
                level *= growth
    return prominence


@part()
def _middle_powers(power: Floats) -> tuple[Floats, Floats]:
    """Return the two powers (2, blocks) in the middle of each block, whose mean in decades is its median."""
    blocks = power.shape[1] // FLOOR_BINS
    ranked = np.empty((FLOOR_BINS, 2 * blocks))
    for c in range(2):
        for b in range(blocks):
            for k in range(FLOOR_BINS):
                ranked[k, c * blocks + b] = power[c, b * FLOOR_BINS + k]
    for pair in range(_NETWORK.shape[0]):
        lower, upper = ranked[_NETWORK[pair, 0]], ranked[_NETWORK[pair, 1]]
        for b in range(2 * blocks):
            one, other = lower[b], upper[b]
            lower[b] = min(one, other) + 0.0  # without a sum LLVM stores under a mask, twice as slow
            upper[b] = max(one, other)
    middle = ranked[FLOOR_BINS // 2 - 1 : FLOOR_BINS // 2 + 1].reshape(2, 2, blocks)
    return middle[0], middle[1]
