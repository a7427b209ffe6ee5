"""The height of each bin of a spectrum above the floor beside it."""

import numpy as np
import pytest

from monochord.core.types import Floats
from monochord.perception.reader.cells import FLOOR_BINS, FLOOR_DECADES, MAX_DECADES, prominences


def plain(power: Floats, strongest: float) -> Floats:
    """The definition: medians of blocks, lines between their middles, and every logarithm taken."""
    decades = np.log10(power + 1e-12 * strongest)
    blocks = power.size // FLOOR_BINS
    floor = np.median(decades[: blocks * FLOOR_BINS].reshape(blocks, FLOOR_BINS), axis=1)
    place = np.clip(np.arange(power.size) / FLOOR_BINS - 0.5, 0.0, blocks - 1.0)
    level = np.interp(place, np.arange(blocks), floor)
    return np.clip(decades - level - FLOOR_DECADES, 0.0, MAX_DECADES)


@pytest.mark.parametrize(("bins", "slope"), [(480, 0.0), (2206, 6.0)])
def test_a_prominence_is_the_height_above_the_medians(bins: int, slope: float) -> None:
    random = np.random.default_rng(bins)
    power = random.exponential(size=(2, bins)) * 10.0 ** (-8.0 - slope * np.arange(bins) / bins)
    for line in range(30, bins - 30, 97):
        power[:, line - 1 : line + 2] += np.array([0.25, 1.0, 0.25]) * 10.0 ** random.uniform(-6.0, -1.0)
    height = power.max(axis=1, keepdims=True)
    expected = np.stack([plain(each, most[0]) for each, most in zip(power, height, strict=True)])
    inner = slice(0, bins - FLOOR_BINS)  # at the very end the floor goes on as it was
    np.testing.assert_allclose(prominences(power, height)[:, inner], expected[:, inner], atol=2e-3)
    assert 0.01 < np.mean(expected > 0.0) < 0.2
