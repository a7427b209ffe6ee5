"""A surface: smooth, of unit height, and the same each time."""

import numpy as np
import pytest

from monochord.physics.twin import roughness


def test_heights_have_unit_rms_and_no_steps() -> None:
    rng = np.random.default_rng(2)
    places = rng.uniform(-1e4, 1e4, (6000, 2))
    heights = np.array([roughness.height(3, x, y) for x, y in places])
    assert np.sqrt(np.mean(heights**2)) == pytest.approx(1.0, abs=0.06)
    near = np.array([roughness.height(3, x + 1e-5, y) for x, y in places[:500]])
    assert np.abs(near - heights[:500]).max() < 1e-3


def test_a_place_keeps_its_height_and_seeds_differ() -> None:
    assert roughness.height(3, 12.3, -4.5) == roughness.height(3, 12.3, -4.5)
    assert roughness.height(3, 12.3, -4.5) != roughness.height(19, 12.3, -4.5)


def test_neighbouring_seeds_and_touches_share_nothing() -> None:
    rng = np.random.default_rng(4)
    places = rng.uniform(0.0, 1e4, (4000, 2))
    one = [roughness.height(1, x, y) for x, y in places]
    for zoom in (1.0, 0.5, 2.0):
        other = [roughness.height(2, zoom * x, zoom * y) for x, y in places]
        assert abs(np.corrcoef(one, other)[0, 1]) < 0.06
    keys = {int(roughness.surface(seed, touch)) for seed in range(40) for touch in range(8)}
    assert len(keys) == 320
