import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.lab.pressing import depth_under, force_at_depth
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import geometric_tension
from monochord.physics.twin import Scene, advance, begin, hold

STRING = load_sensor("prototype").string


def test_force_and_depth_undo_each_other() -> None:
    x, force = np.meshgrid(np.linspace(0.01, 0.19, 19), np.linspace(0.01, 5.0, 20))
    np.testing.assert_allclose(force_at_depth(STRING, x, depth_under(STRING, x, force)), force, rtol=1e-12)
    assert depth_under(STRING, 0.1, 0.0) == 0.0


def test_the_force_is_that_of_two_taut_sides() -> None:
    x, depth = 0.06, 1e-3
    force = float(force_at_depth(STRING, x, depth))
    tension = float(geometric_tension(STRING, x, force))
    assert force == pytest.approx(tension * (depth / x + depth / (STRING.length - x)))


def test_the_twin_at_rest_answers_with_the_force_of_the_depth() -> None:
    scene = Scene(touches=(hold(0.08, 1.2, load_material("plastic")),), drivers=(False, False))
    twin = begin(load_sensor("prototype"), scene)
    take, _ = advance(twin, 30000)
    assert take.labels.reaction[0, -5000:].mean() == pytest.approx(1.2, rel=5e-3)


def test_a_pull_is_refused() -> None:
    with pytest.raises(InputError, match="force"):
        depth_under(STRING, 0.1, -1.0)
