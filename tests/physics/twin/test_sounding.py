"""What is heard of the string, and when it counts as settled."""

import numpy as np
import pytest
from tests.physics.twin.built import PLASTIC, SENSOR, key, touch

from monochord.physics.twin import Pluck, Scene, advance, begin, hold, retouch


def test_a_steady_sound_is_settled_until_a_touch_changes() -> None:
    twin = begin(SENSOR, Scene(pluck=Pluck(position=0.07, height=1e-4)))
    take, twin = advance(twin, 3 * 44100)
    assert take.labels.settled[0] == 0
    assert take.labels.settled[-1] == 1
    after = advance(retouch(twin, (hold(0.08, 1.0, PLASTIC),)), 400)[0]
    assert after.labels.settled[-1] == 0


def test_a_moving_touch_is_not_settled() -> None:
    rolls = touch(key(0.0, 0.08, 1.0), key(2.0, 0.1, 1.0))
    labels = advance(begin(SENSOR, Scene(touches=(rolls,))), 44100)[0].labels
    assert labels.settled.max() == 0


def test_a_string_at_rest_gives_hiss_alone() -> None:
    sound = advance(begin(SENSOR, Scene(drivers=(False, False))), 20000)[0].microphones
    assert sound.std(axis=1) == pytest.approx([SENSOR.pickups.hiss] * 2, rel=0.03)
    assert abs(np.mean(sound[0] * sound[1])) < 0.03 * SENSOR.pickups.hiss**2
