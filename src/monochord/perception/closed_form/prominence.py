"""How far each bin of a spectrum stands out of the floor between the lines.

Every window has it computed before anything is known of it, so it is quick: all medians are found at once,
by a sorting network, and of the bins that noise reaches no logarithm is taken.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats

FLOOR_BINS, FLOOR_DECADES, MAX_DECADES = 24, 0.7, 4.0
"""Bins over which a median is the floor; decades above it that noise reaches, and that count at most."""


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


@numba.njit(cache=True, error_model="numpy")
def prominences(power: Floats, height: Floats) -> Floats:
    """Return by how many decades each bin stands out of the floor, a median beside it, (2, bins).

    Parameters
    ----------
    power
        Power spectra (2, bins).
    height
        Powers (2, lines) of the strongest lines, strongest first; 120 dB below is the least floor.
    """
    bins = power.shape[1]
    blocks = bins // FLOOR_BINS
    prominence = np.zeros(power.shape)
    for c in range(2):
        least = 1.0e-12 * height[c, 0]
        floor = _floor(power[c], least)
        for b in range(blocks):
            lowest = min(floor[max(b - 1, 0)], floor[b], floor[min(b + 1, blocks - 1)])
            quiet = 0.999 * 10.0 ** (lowest + FLOOR_DECADES) - least
            for k in range(b * FLOOR_BINS, (b + 1) * FLOOR_BINS if b < blocks - 1 else bins):
                if power[c, k] < quiet:
                    continue
                place = min(max(k / FLOOR_BINS - 0.5, 0.0), blocks - 1.001)
                q = int(place)
                level = floor[q] + (place - q) * (floor[q + 1] - floor[q])
                above = np.log10(power[c, k] + least) - level - FLOOR_DECADES
                prominence[c, k] = min(max(above, 0.0), MAX_DECADES)
    return prominence


@numba.njit(cache=True, error_model="numpy")
def _floor(power: Floats, least: float) -> Floats:
    """Return the median (blocks,) of log10 of each block's power (bins,), to which `least` is added."""
    blocks = power.size // FLOOR_BINS
    ranked = np.ascontiguousarray(power[: blocks * FLOOR_BINS].reshape(blocks, FLOOR_BINS).T)
    for pair in range(_NETWORK.shape[0]):
        lower, upper = ranked[_NETWORK[pair, 0]], ranked[_NETWORK[pair, 1]]
        for b in range(blocks):
            one, other = lower[b], upper[b]
            lower[b] = min(one, other)
            upper[b] = max(one, other)
    below, above = ranked[FLOOR_BINS // 2 - 1], ranked[FLOOR_BINS // 2]
    return 0.5 * (np.log10(below + least) + np.log10(above + least))
