"""The plan of steps and modes, and what it promises."""

from dataclasses import replace

import numpy as np
import pytest
from tests.physics.twin.built import STRING

from monochord.core.errors import InputError
from monochord.physics.strings import load_string, string_names
from monochord.physics.theory import bending_stiffness
from monochord.physics.twin import rate


@pytest.mark.parametrize("name", string_names())
def test_every_preset_has_a_plan_within_the_tolerance(name: str) -> None:
    found = rate.plan(load_string(name).string, 44100.0)
    assert found.error <= 0.05
    assert rate.padded(found.count) >= found.count


def test_shorter_steps_promise_more() -> None:
    errors = [rate.plan(STRING, 44100.0, finer=finer).error for finer in (1, 2, 4)]
    assert errors[0] > errors[1] > errors[2]


def test_modes_are_those_of_a_hinged_stiff_string() -> None:
    k = np.arange(1, 5) * np.pi / STRING.length
    square = (STRING.tension * k**2 + bending_stiffness(STRING) * k**4) / STRING.linear_density
    np.testing.assert_allclose(rate.mode_frequencies(STRING, 4), np.sqrt(square))
    assert rate.touch_weights(np.array([1.0, 1e4]), 1e-7, 0.5) == pytest.approx(1.0, abs=1e-6)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="1, 2, 4, 8, 16 or 32"):
        rate.plan(STRING, 44100.0, finer=0)
    with pytest.raises(InputError, match="256 at most"):
        rate.padded(257)
    with pytest.raises(InputError, match="too fast"):
        rate.plan(replace(STRING, core_diameter=3e-3, linear_density=1e-3), 16000.0, finer=1)
