"""A bristle gives away energy and never gains any."""

import numpy as np
import pytest

from monochord.physics.twin import friction


def test_friction_falls_from_static_to_kinetic() -> None:
    assert friction.grip(0.0, 0.4, 0.3, 0.01) == pytest.approx(0.4)
    assert friction.grip(1.0, 0.4, 0.3, 0.01) == pytest.approx(0.3)
    assert friction.creeping(0.69, 1.0) == 0.0
    assert friction.creeping(-1.0, 1.0) == 1.0
    assert 0.0 < friction.creeping(0.85, 1.0) < 1.0


@pytest.mark.parametrize("loss", [0.0, 3e3])
def test_a_bristle_is_passive(loss: float) -> None:
    rng, z, stiffness = np.random.default_rng(1), 0.0, 1e5
    for moved in rng.normal(0.0, 1e-6, 500):
        fade = float(rng.choice([0.0, rng.exponential(3.0)]))
        before = z
        force, left, z = friction.bristle(z, float(moved), 1e-6, stiffness, loss, fade)
        assert left == pytest.approx(moved - 1e-6 * force)
        stored = 0.5 * stiffness * (z * z - before * before)
        assert force * left >= stored - 1e-20


def test_a_mark_follows_beyond_its_play_only() -> None:
    assert friction.played(1e-3, 5e-4, 5e-4, 0.0, 0.0) == (0.0, 0.0)
    assert friction.played(1e-3, 3e-3, 0.0, 0.0, 0.0) == pytest.approx((2e-3, 0.0))
