"""How far each bin of a spectrum stands out of the floor between the lines.

Every window has it computed before anything is known of it, so it is quick: all medians are found at once,
by a sorting network, and of the bins that noise reaches no logarithm is taken.
"""

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
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


@kernel()
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
