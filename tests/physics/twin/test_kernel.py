"""The compiled whole: how much it does a step, and when it is compiled."""

import numpy as np
from tests.physics.twin.built import PLASTIC, SENSOR, moving

from monochord.physics.twin import Scene, advance, begin, hold, kernel, memory


def test_a_step_takes_two_or_three_rounds() -> None:
    twin = begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),)))
    after = advance(twin, 5000)[1]
    assert 1.0 <= moving(after)["memory"][memory.ROUNDS] / (5000 * twin.plan.finer) < 4.0
    assert np.isfinite(moving(after)["memory"]).all()


def test_a_kernel_is_compiled_once_a_size() -> None:
    assert kernel.kernel(32) is kernel.kernel(32)
    assert kernel.kernel(32) is not kernel.kernel(48)
