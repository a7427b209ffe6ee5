"""Sensitivities are the derivatives of the closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monochord.core.types import Contact, StringParams
from monochord.physics.theory.segments import position_from_far_segment, split_frequencies
from monochord.physics.theory.sensitivity import far_segment_sensitivity, frequency_sensitivities
from monochord.physics.theory.tension import TensionLaw

STRING = StringParams(
    length=0.2, linear_density=4e-4, tension=65.0, core_diameter=2.54e-4, tension_per_force=6.0
)


@given(st.floats(0.02, 0.18), st.floats(0.01, 5.0), st.sampled_from(["linear", "geometric"]))
def test_sensitivities_equal_finite_differences(x: float, force: float, law: TensionLaw) -> None:
    exact = frequency_sensitivities(STRING, Contact(position=x, force=force), law)
    step = 1e-6
    ahead, behind = (split_frequencies(STRING, x + sign * step, force, law) for sign in (1, -1))
    np.testing.assert_allclose(exact[:, 0], (np.array(ahead) - behind) / (2 * step), rtol=1e-5, atol=1e-3)
    step = 1e-4
    harder, softer = (split_frequencies(STRING, x, force + sign * step, law) for sign in (1, -1))
    np.testing.assert_allclose(exact[:, 1], (np.array(harder) - softer) / (2 * step), rtol=1e-4, atol=1e-6)


@given(st.floats(100.0, 2000.0))
def test_far_segment_sensitivity_equals_a_finite_difference(f: float) -> None:
    step = 1e-3
    ahead = position_from_far_segment(f + step, 82.4, 0.65)
    behind = position_from_far_segment(f - step, 82.4, 0.65)
    assert far_segment_sensitivity(f, 82.4, 0.65) == pytest.approx((ahead - behind) / (2 * step), rel=1e-5)


def test_geometric_law_is_blind_to_the_first_touch() -> None:
    first = frequency_sensitivities(STRING, Contact(position=0.1, force=0.0), "geometric")
    np.testing.assert_array_equal(first[:, 1], 0.0)
