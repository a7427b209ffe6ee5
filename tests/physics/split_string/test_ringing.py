"""The compiled ringing against matrix powers in NumPy."""

import numpy as np
import pytest

from monochord.physics.split_string.modes import free_motion
from monochord.physics.split_string.ringing import ring


def test_modes_ring_as_their_exact_motion_says() -> None:
    random = np.random.default_rng(0)
    frequency, decay = random.uniform(1e3, 1e5, 23), np.full(23, 40.0)
    shape, q, v = random.standard_normal((2, 23)), random.standard_normal(23), random.standard_normal(23)
    heard = np.ones((2, 50))
    q_after, v_after = q.copy(), v.copy()
    ring(free_motion(frequency, decay, 1e-5), shape, q_after, v_after, heard)
    for sample in (0, 1, 49):
        moved = free_motion(frequency, decay, sample * 1e-5)
        assert heard[:, sample] == pytest.approx(1.0 + shape @ (moved[2] * q + moved[3] * v), rel=1e-9)
    moved = free_motion(frequency, decay, 50e-5)
    assert q_after == pytest.approx(moved[0] * q + moved[1] * v, rel=1e-8, abs=1e-10)
