"""Touches of the whole string: how they press together, rub, and begin and end."""

import numpy as np
import pytest
from tests.physics.twin.built import FOAM, PLASTIC, SENSOR, key, moving, touch, with_touch

from monochord.physics.twin import Scene, advance, begin, hold, memory

STILL = (False, False)


def test_several_touches_press_as_each_was_told() -> None:
    pressed = (hold(0.06, 0.5, PLASTIC), hold(0.09, 1.0, PLASTIC), hold(0.13, 2.0, FOAM))
    twin = with_touch(begin(SENSOR, Scene(touches=pressed, drivers=STILL)), ROUGH=0.0)
    labels = advance(twin, 44100)[0].labels
    assert labels.force[:, -1] == pytest.approx(
        [0.5, 1.0, 2.0], rel=0.1
    )  # their shapes superpose but roughly
    assert labels.contact[:, -1].tolist() == [1, 1, 1]


def test_a_sliding_object_feels_its_kinetic_friction() -> None:
    twin = with_touch(
        begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC, across=0.2),), drivers=STILL)), ROUGH=0.0
    )
    take, after = advance(twin, 44100)
    own = moving(after)["contact"][0]
    pull = own[memory.GRIP] * own[memory.Z]
    assert abs(pull) == pytest.approx(PLASTIC.friction_kinetic * own[memory.NOW], rel=0.15)
    assert take.labels.across[0, -4410:].mean() == pytest.approx(0.2, rel=0.05)
    assert take.labels.slip[0, -4410:].all()


def test_a_new_object_starts_at_its_surfaces_height() -> None:
    # A height that came in with the first sliding would push the string by the whole roughness at once.
    twin = begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),), drivers=STILL), seed=5)
    first, later = advance(twin, 1)[1], advance(twin, 4410)[1]
    heights = [moving(one)["contact"][0, memory.HEIGHT] for one in (first, later)]
    assert heights[0] != 0.0
    assert abs(heights[1] - heights[0]) < 0.2 * PLASTIC.roughness


def test_an_object_that_goes_away_is_off_after_a_while() -> None:
    leaves = touch(key(0.0, 0.08, 1.0), key(0.1, 0.08, 1.0), key(0.11, 0.08, 0.0, 2e-3))
    labels = advance(begin(SENSOR, Scene(touches=(leaves,), drivers=STILL)), 8820)[0].labels
    assert labels.contact[0, 4000] == 1
    assert labels.contact[0, -1] == 0
    assert labels.friction[0, -1] == 0
    assert np.all(labels.force[0, labels.contact[0] == 0] == 0.0)
