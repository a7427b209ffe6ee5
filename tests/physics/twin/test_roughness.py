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
