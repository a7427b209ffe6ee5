"""Bending stiffness and losses of a real wire."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import kve

from monochord.core.errors import InputError
from monochord.core.types import StringParams
from monochord.physics.strings import load_string
from monochord.physics.theory import Losses, bending_stiffness, decay_rates, outer_diameter
from monochord.physics.theory.stiffness import inharmonicity, partial_numbers, stiff_partials

PLAIN = StringParams(length=0.65, linear_density=4e-4, tension=73.0, core_diameter=2.54e-4)


def test_coefficient_follows_from_bending_stiffness() -> None:
    # B = pi^2 E I / (T L^2), with the second moment of area I = pi d^4 / 64 of a round wire.
    moment = np.pi * PLAIN.core_diameter**4 / 64.0
    expected = np.pi**2 * PLAIN.young_modulus * moment / (PLAIN.tension * PLAIN.length**2)
    assert inharmonicity(PLAIN) == pytest.approx(expected, rel=1e-12)


def test_flexible_string_is_harmonic() -> None:
    assert inharmonicity(StringParams(length=0.65, linear_density=4e-4, tension=73.0)) == 0.0


@settings(max_examples=30)
@given(st.floats(0.01, 0.65))
def test_segment_coefficient_goes_with_one_over_length_squared(length: float) -> None:
    assert inharmonicity(PLAIN, length) * length**2 == pytest.approx(inharmonicity(PLAIN) * 0.65**2)


@settings(max_examples=30)
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


@settings(max_examples=30)
@given(st.floats(50.0, 2000.0), st.floats(0.0, 1e-3), st.floats(10.0, 10000.0))
def test_partial_numbers_are_all_that_fit(f0: float, b: float, highest: float) -> None:
    n = partial_numbers(highest, f0, b)
    assert np.all(stiff_partials(f0, b, n) <= highest)
    assert stiff_partials(f0, b, float(n.size + 1)) > highest


SHORT = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0, core_diameter=2.54e-4)
FREQUENCIES = np.geomspace(100.0, 20000.0, 12)
NOTHING = Losses(air_viscosity=0.0, air_density=0.0, viscoelastic=0.0, thermoelastic=0.0, support=0.0)


def test_without_losses_nothing_dies_away() -> None:
    np.testing.assert_array_equal(decay_rates(SHORT, NOTHING, FREQUENCIES), 0.0)


def test_losses_add() -> None:
    whole = Losses()
    parts = [
        dataclasses.replace(NOTHING, air_viscosity=whole.air_viscosity, air_density=whole.air_density),
        dataclasses.replace(NOTHING, viscoelastic=whole.viscoelastic),
        dataclasses.replace(NOTHING, thermoelastic=whole.thermoelastic),
        dataclasses.replace(NOTHING, support=whole.support),
    ]
    total = sum(decay_rates(SHORT, part, FREQUENCIES) for part in parts)
    np.testing.assert_allclose(decay_rates(SHORT, whole, FREQUENCIES), total, rtol=1e-13)


def test_air_drag_is_close_to_stokes_exact_cylinder() -> None:
    # A cylinder of radius a that oscillates in a viscous fluid (Stokes 1851) drags the complex mass
    # rho pi a^2 [1 + 4 K1(z) / (z K0(z))], z = a sqrt(i w rho / eta). The losses keep two terms of its series
    # at large z; |z| is 0.8 to 12 here, and the terms left out are at most 8 % of the drag.
    air = dataclasses.replace(NOTHING, air_viscosity=1.8e-5, air_density=1.2)
    half, w = outer_diameter(SHORT) / 2.0, 2.0 * np.pi * FREQUENCIES
    z = half * np.sqrt(1j * w * 1.2 / 1.8e-5)
    mass = 1.2 * np.pi * half**2 * (1.0 + 4.0 * kve(1, z) / (z * kve(0, z)))
    drag = np.real(1j * w * mass)
    np.testing.assert_allclose(decay_rates(SHORT, air, FREQUENCIES), drag / (2.0 * 3.978e-4), rtol=0.08)


def test_viscoelastic_loss_is_that_of_a_complex_modulus() -> None:
    # With E (1 + i delta) the n-th mode has mu w^2 = T k^2 + E I (1 + i delta) k^4, and decays as Im(w).
    bending = dataclasses.replace(NOTHING, viscoelastic=4.5e-3)
    k = np.arange(1, 6) * np.pi / 0.2
    w = np.sqrt((65.0 * k**2 + bending_stiffness(SHORT) * (1.0 + 4.5e-3j) * k**4) / 3.978e-4)
    rates = decay_rates(SHORT, bending, np.real(w) / (2.0 * np.pi))
    # E I k^2 / T, up to 0.4 % for the fifth mode, enters three times.
    np.testing.assert_allclose(rates, np.imag(w), rtol=0.015)


def test_viscoelastic_loss_grows_with_the_cube_of_frequency_and_needs_a_core() -> None:
    bending = dataclasses.replace(NOTHING, viscoelastic=4.5e-3)
    rates = decay_rates(SHORT, bending, np.array([1000.0, 2000.0]))
    assert rates[1] == pytest.approx(8.0 * rates[0])
    flexible = dataclasses.replace(SHORT, core_diameter=0.0)
    np.testing.assert_array_equal(decay_rates(flexible, bending, FREQUENCIES), 0.0)


@pytest.mark.parametrize("name", ["thermoelastic", "support"])
def test_constant_quality_factor_decays_in_as_many_periods_at_any_frequency(name: str) -> None:
    losses = dataclasses.replace(NOTHING, **{name: 1e-3})
    np.testing.assert_allclose(decay_rates(SHORT, losses, FREQUENCIES), math.pi * 1e-3 * FREQUENCIES)


def test_prototype_rings_for_some_tenths_of_a_second_and_its_support_takes_most() -> None:
    string, fundamental = load_string("prototype").string, np.array([1000.0])
    rate = decay_rates(string, Losses(), fundamental)[0]
    assert 0.1 < 1.0 / rate < 0.5
    support = decay_rates(string, dataclasses.replace(NOTHING, support=Losses().support), fundamental)[0]
    assert support > 0.5 * rate


def test_high_partials_die_first_in_any_shape() -> None:
    rates = decay_rates(SHORT, Losses(), FREQUENCIES.reshape(3, 4))
    assert rates.shape == (3, 4)
    assert np.all(np.diff(rates.ravel()) > 0.0)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: inharmonicity(PLAIN, 0.0),
        lambda: stiff_partials(100.0, -0.1, 10.0),
        lambda: decay_rates(SHORT, Losses(), np.array([0.0, 100.0])),
        lambda: Losses(support=-1.0),
        lambda: Losses(air_viscosity=math.nan),
    ],
)
def test_what_makes_no_sense_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
