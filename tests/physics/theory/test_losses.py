"""Decay rates: each loss alone against another road to it, their sum, and the size that a build shows."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import kve

from monochord.core.errors import InputError
from monochord.core.types import StringParams
from monochord.physics.strings import load_string
from monochord.physics.theory.hertz import outer_diameter
from monochord.physics.theory.loaded import bending_stiffness
from monochord.physics.theory.losses import Losses, decay_rates

PLAIN = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0, core_diameter=2.54e-4)
FREQUENCIES = np.geomspace(100.0, 20000.0, 12)
NOTHING = Losses(air_viscosity=0.0, air_density=0.0, viscoelastic=0.0, thermoelastic=0.0, support=0.0)


def test_without_losses_nothing_dies_away() -> None:
    np.testing.assert_array_equal(decay_rates(PLAIN, NOTHING, FREQUENCIES), 0.0)


def test_losses_add() -> None:
    whole = Losses()
    parts = [
        dataclasses.replace(NOTHING, air_viscosity=whole.air_viscosity, air_density=whole.air_density),
        dataclasses.replace(NOTHING, viscoelastic=whole.viscoelastic),
        dataclasses.replace(NOTHING, thermoelastic=whole.thermoelastic),
        dataclasses.replace(NOTHING, support=whole.support),
    ]
    total = sum(decay_rates(PLAIN, part, FREQUENCIES) for part in parts)
    np.testing.assert_allclose(decay_rates(PLAIN, whole, FREQUENCIES), total, rtol=1e-13)


def test_air_drag_is_close_to_stokes_exact_cylinder() -> None:
    # A cylinder of radius a that oscillates in a viscous fluid (Stokes 1851) drags the complex mass
    # rho pi a^2 [1 + 4 K1(z) / (z K0(z))], z = a sqrt(i w rho / eta). The losses keep two terms of its series
    # at large z; |z| is 0.8 to 12 here, and the terms left out are at most 8 % of the drag.
    air = dataclasses.replace(NOTHING, air_viscosity=1.8e-5, air_density=1.2)
    half, w = outer_diameter(PLAIN) / 2.0, 2.0 * np.pi * FREQUENCIES
    z = half * np.sqrt(1j * w * 1.2 / 1.8e-5)
    mass = 1.2 * np.pi * half**2 * (1.0 + 4.0 * kve(1, z) / (z * kve(0, z)))
    drag = np.real(1j * w * mass)
    np.testing.assert_allclose(decay_rates(PLAIN, air, FREQUENCIES), drag / (2.0 * 3.978e-4), rtol=0.08)


def test_viscoelastic_loss_is_that_of_a_complex_modulus() -> None:
    # With E (1 + i delta) the n-th mode has mu w^2 = T k^2 + E I (1 + i delta) k^4, and decays as Im(w).
    bending = dataclasses.replace(NOTHING, viscoelastic=4.5e-3)
    k = np.arange(1, 6) * np.pi / 0.2
    w = np.sqrt((65.0 * k**2 + bending_stiffness(PLAIN) * (1.0 + 4.5e-3j) * k**4) / 3.978e-4)
    rates = decay_rates(PLAIN, bending, np.real(w) / (2.0 * np.pi))
    # E I k^2 / T, up to 0.4 % for the fifth mode, enters three times.
    np.testing.assert_allclose(rates, np.imag(w), rtol=0.015)


def test_viscoelastic_loss_grows_with_the_cube_of_frequency_and_needs_a_core() -> None:
    bending = dataclasses.replace(NOTHING, viscoelastic=4.5e-3)
    rates = decay_rates(PLAIN, bending, np.array([1000.0, 2000.0]))
    assert rates[1] == pytest.approx(8.0 * rates[0])
    flexible = dataclasses.replace(PLAIN, core_diameter=0.0)
    np.testing.assert_array_equal(decay_rates(flexible, bending, FREQUENCIES), 0.0)


@pytest.mark.parametrize("name", ["thermoelastic", "support"])
def test_constant_quality_factor_decays_in_as_many_periods_at_any_frequency(name: str) -> None:
    losses = dataclasses.replace(NOTHING, **{name: 1e-3})
    np.testing.assert_allclose(decay_rates(PLAIN, losses, FREQUENCIES), math.pi * 1e-3 * FREQUENCIES)


def test_prototype_rings_for_some_tenths_of_a_second_and_its_support_takes_most() -> None:
    string, fundamental = load_string("prototype").string, np.array([1000.0])
    rate = decay_rates(string, Losses(), fundamental)[0]
    assert 0.1 < 1.0 / rate < 0.5
    support = decay_rates(string, dataclasses.replace(NOTHING, support=Losses().support), fundamental)[0]
    assert support > 0.5 * rate


def test_high_partials_die_first_in_any_shape() -> None:
    rates = decay_rates(PLAIN, Losses(), FREQUENCIES.reshape(3, 4))
    assert rates.shape == (3, 4)
    assert np.all(np.diff(rates.ravel()) > 0.0)


def test_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(InputError, match="frequencies 0: allowed is above 0"):
        decay_rates(PLAIN, Losses(), np.array([0.0, 100.0]))
    with pytest.raises(InputError, match="support -1"):
        Losses(support=-1.0)
    with pytest.raises(InputError, match="air viscosity nan"):
        Losses(air_viscosity=math.nan)
