"""Stiff strings: the coefficient, its scaling, and the partials."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monochord.core.errors import InputError
from monochord.core.types import StringParams
from monochord.physics.theory.stiffness import (
    inharmonicity,
    partial_numbers,
    segment_inharmonicity,
    stiff_partials,
)

PLAIN = StringParams(length=0.65, linear_density=4e-4, tension=73.0, core_diameter=2.54e-4)


def test_coefficient_follows_from_bending_stiffness() -> None:
    # B = pi^2 E I / (T L^2), with the second moment of area I = pi d^4 / 64 of a round wire.
    moment = np.pi * PLAIN.core_diameter**4 / 64.0
    expected = np.pi**2 * PLAIN.young_modulus * moment / (PLAIN.tension * PLAIN.length**2)
    assert inharmonicity(PLAIN) == pytest.approx(expected, rel=1e-12)


def test_flexible_string_is_harmonic() -> None:
    assert inharmonicity(StringParams(length=0.65, linear_density=4e-4, tension=73.0)) == 0.0


@given(st.floats(0.01, 0.65))
def test_segment_coefficient_goes_with_one_over_length_squared(length: float) -> None:
    assert segment_inharmonicity(PLAIN, length) * length**2 == pytest.approx(inharmonicity(PLAIN) * 0.65**2)


@given(st.floats(20.0, 2000.0), st.floats(0.0, 1e-3))
def test_partials_are_sharp_and_ascending(f0: float, b: float) -> None:
    n = np.arange(1.0, 30.0)
    partials = stiff_partials(f0, b, n)
    assert np.all(partials >= n * f0)
    assert np.all(np.diff(partials) >= f0 * (1.0 - 1e-12))


def test_partial_is_an_eigenfrequency_of_the_stiff_string() -> None:
    # mu y_tt = T y_xx - E I y_xxxx with hinged ends: omega^2 = (T k^2 + E I k^4) / mu, k = n pi / L.
    moment = np.pi * PLAIN.core_diameter**4 / 64.0
    f0 = np.sqrt(PLAIN.tension / PLAIN.linear_density) / (2.0 * PLAIN.length)
    for n in (1.0, 7.0, 20.0):
        k = n * np.pi / PLAIN.length
        omega_2 = (PLAIN.tension * k**2 + PLAIN.young_modulus * moment * k**4) / PLAIN.linear_density
        assert stiff_partials(f0, inharmonicity(PLAIN), n) == pytest.approx(np.sqrt(omega_2) / (2 * np.pi))


@given(st.floats(50.0, 2000.0), st.floats(0.0, 1e-3), st.floats(10.0, 10000.0))
def test_partial_numbers_are_all_that_fit(f0: float, b: float, highest: float) -> None:
    n = partial_numbers(highest, f0, b)
    assert np.all(stiff_partials(f0, b, n) <= highest)
    assert stiff_partials(f0, b, float(n.size + 1)) > highest


def test_impossible_is_refused() -> None:
    with pytest.raises(InputError, match="length 0"):
        segment_inharmonicity(PLAIN, 0.0)
    with pytest.raises(InputError, match="stretch of partials"):
        stiff_partials(100.0, -0.1, 10.0)
