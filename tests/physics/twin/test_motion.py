"""What keys ask of an object."""

import numpy as np
import pytest
from tests.physics.twin.built import STRING

from monochord.physics.theory import geometric_tension, stretch_stiffness
from monochord.physics.twin import motion

KEYS = np.array([[0.1, 0.05, 0.0, 1e-3, 0.0], [0.3, 0.07, 2.0, 0.0, 0.1], [0.0, 0.0, 0.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("time", "true"), [(0.0, KEYS[0, 1:]), (0.2, (KEYS[0, 1:] + KEYS[1, 1:]) / 2.0), (9.0, KEYS[1, 1:])]
)
def test_keys_are_joined_by_lines_and_hold_at_their_ends(time: float, true: np.ndarray) -> None:
    want = np.full(5, 7.0)
    motion.asked(KEYS, 2, time, want)
    np.testing.assert_allclose(want[:4], true, rtol=1e-12, atol=1e-15)
    assert want[4] == 7.0


def test_depth_gives_the_force_back() -> None:
    deep = motion.depth_of(2.0, 1e4, 0.0, 3e-4, 1e-5, 0.0)
    assert deep == pytest.approx(2.0 / 1e4 + 2.0 * 3e-4 + 1e-5)
    assert motion.cross_compliance(0.05, 0.08, 0.2, 65.0) == pytest.approx(0.05 * 0.12 / (65.0 * 0.2))
    assert motion.between(np.array([0.0, 1.0, 4.0]), 0.75) == pytest.approx(2.5)


@pytest.mark.parametrize("force", [0.1, 1.0, 10.0])
def test_rise_is_that_of_theory(force: float) -> None:
    found = motion.geometric_rise(force, 0.08, STRING.length, STRING.tension, stretch_stiffness(STRING))
    assert found == pytest.approx(geometric_tension(STRING, 0.08, force) - STRING.tension, rel=1e-6)


def test_a_tension_drifts_by_a_quarter_at_most() -> None:
    assert motion.drifted(1.0, 0.5, 4.0, 65.0) == pytest.approx(3.0)
    assert motion.drifted(-0.13, -0.567, 20.0, 5.15) == pytest.approx(-0.25 * 5.15)
    assert motion.drifted(0.0, 1.0, 1e6, 65.0) == pytest.approx(16.25)
