"""The surface of an object: height along the path that has slid past, a fixed landscape for each seed.

Three octaves of value noise with amplitude halved from one to the next: a self-affine profile of Hurst exponent
one between the correlation length and a quarter of it, as ground and printed surfaces roughly are.
"""

import numpy as np

from monochord.physics.twin.part import part

OCTAVES = 3
LEVEL = 1.34
"""Makes the root mean square of the sum one."""


@part
def mixed_bits(seed: int, index: int) -> np.uint64:
    """Return 64 bits that seed and index determine, by the mixer of SplitMix64 (Steele et al. 2014)."""
    x = np.uint64(seed) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(index)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@part
def hashed(seed: int, index: int) -> float:
    """Return a uniform number in -1 to 1 that seed and index determine."""
    return np.float64(np.int64(mixed_bits(seed, index) >> np.uint64(11))) * 2.0**-52 - 1.0


@part
def height(seed: int, path: float) -> float:
    """Return the height at a path in correlation lengths, of unit root mean square."""
    total, share = 0.0, 1.0
    for octave in range(OCTAVES):
        cell = np.floor(path)
        t = path - cell
        i = np.int64(cell)
        low, high = hashed(seed + octave, i), hashed(seed + octave, i + 1)
        total += share * (low + (high - low) * t * t * (3.0 - 2.0 * t))
        share *= 0.5
        path *= 2.0
    return LEVEL * total
