"""The rough surface of an object: a fixed random height map for each seed, read where the string touches it.

Five octaves of value noise over the plane with amplitude halved from one to the next: self-affine, of Hurst
exponent one, between the correlation length and a sixteenth of it. Measured profiles have exponents of some
0.7 to 1 (Persson et al. 2005); the patch of contact, tens of micrometres wide, averages over what is finer,
which steepens them. A place always has the same height, so that a string that rocks under an object at rest
is not excited anew.
"""

import numpy as np

from monochord.physics.twin.jit import called

OCTAVES = 5
SEED_INDEX = 1 << 61
"""Indices from here on give seeds, far from all indices of places and frames."""
RMS_SCALE = 2.02
"""Scales the sum of octaves to unit root mean square."""


@called
def mixed_bits(seed: int, index: int) -> np.uint64:
    """Return 64 random bits for a seed and index, by the mixer of SplitMix64 (Steele et al. 2014)."""
    x = np.uint64(seed) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(np.int64(index))
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@called
def hashed(seed: int, index: int) -> float:
    """Return a uniform random number in -1 to 1 for a seed and index."""
    return np.float64(np.int64(mixed_bits(seed, index) >> np.uint64(11))) * 2.0**-52 - 1.0


@called
def derived_seed(seed: int, index: int) -> int:
    """Return a seed below 2^62, independent of those of neighbouring seeds and indices."""
    return int(np.int64(mixed_bits(seed, SEED_INDEX + index) >> np.uint64(2)))


@called
def surface_seed(seed: int, touch: int) -> int:
    """Return the seed of a touch's surface."""
    return derived_seed(seed, OCTAVES + touch)


@called
def height(seed: int, across: float, along: float) -> float:
    """Return the height at a place, both in correlation lengths; of unit root mean square over the plane."""
    total, share = 0.0, 1.0
    for octave in range(OCTAVES):
        column, row = np.floor(across), np.floor(along)
        x, y = across - column, along - row
        x, y = x * x * (3.0 - 2.0 * x), y * y * (3.0 - 2.0 * y)
        key, i = derived_seed(seed, octave), (int(column) << 24) + int(row)
        near, far = hashed(key, i), hashed(key, i + (1 << 24))
        near += y * (hashed(key, i + 1) - near)
        far += y * (hashed(key, i + (1 << 24) + 1) - far)
        total += share * (near + x * (far - near))
        share *= 0.5
        across *= 2.0
        along *= 2.0
    return RMS_SCALE * total
