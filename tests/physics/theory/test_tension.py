"""Tension laws: the cubic solved, its limits, and the force that explains a tension."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monochord.core.errors import InputError
from monochord.core.types import StringParams
from monochord.physics.theory.tension import (
    check_law,
    damping_under,
    force_from_tension,
    geometric_tension,
    linear_tension,
    stretch_stiffness,
    tension_from_force,
    wave_speed,
)

PLAIN = StringParams(
    length=0.65,
    linear_density=4e-4,
    tension=73.0,
    core_diameter=2.54e-4,
    tension_per_force=6.0,
    damping_per_force=0.01,
)
FLEXIBLE = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)
INSIDE = st.floats(0.001, 0.649)


def test_linear_laws() -> None:
    assert linear_tension(PLAIN, 2.0) == 85.0
    assert damping_under(PLAIN, 2.0) == pytest.approx(0.04)
    assert wave_speed(PLAIN) == pytest.approx(np.sqrt(73.0 / 4e-4))
    assert wave_speed(PLAIN, 2.0) == pytest.approx(np.sqrt(85.0 / 4e-4))
    np.testing.assert_allclose(wave_speed(PLAIN, np.array([0.0, 2.0]))[1], wave_speed(PLAIN, 2.0))


@settings(max_examples=30)
@given(INSIDE, st.floats(0.0, 100.0))
def test_geometric_tension_balances_the_press_and_the_stretch(x: float, force: float) -> None:
    tension = geometric_tension(PLAIN, x, force)
    deflection = force * x * (0.65 - x) / (tension * 0.65)
    elongation = deflection**2 * 0.65 / (2.0 * x * (0.65 - x))
    rise = stretch_stiffness(PLAIN) * elongation / 0.65
    assert tension == pytest.approx(73.0 + rise, rel=1e-12)


def test_light_press_agrees_with_the_exact_triangle() -> None:
    # The exact geometry, square roots and all, solved by iteration, where the press is light (slope 0.7 %).
    x, force, length = 0.2, 1.0, PLAIN.length
    deflection, tension = 0.0, PLAIN.tension
    for _ in range(200):
        sides = np.hypot(x, deflection), np.hypot(length - x, deflection)
        tension = PLAIN.tension + stretch_stiffness(PLAIN) * (sum(sides) - length) / length
        deflection = force / (tension * (1.0 / sides[0] + 1.0 / sides[1]))
    exact_rise = tension - PLAIN.tension
    assert geometric_tension(PLAIN, x, force) - 73.0 == pytest.approx(exact_rise, rel=1e-3)


@settings(max_examples=30)
@given(INSIDE)
def test_rise_is_quadratic_for_a_light_press(x: float) -> None:
    light = geometric_tension(PLAIN, x, 0.05) - 73.0
    double = geometric_tension(PLAIN, x, 0.1) - 73.0
    assert double == pytest.approx(4.0 * light, rel=1e-3, abs=1e-12)


@settings(max_examples=30)
@given(INSIDE, st.floats(0.0, 10.0), st.floats(0.01, 1.0))
def test_harder_is_never_looser(x: float, force: float, more: float) -> None:
    assert geometric_tension(PLAIN, x, force + more) > geometric_tension(PLAIN, x, force) >= 73.0


@settings(max_examples=30)
@given(INSIDE, st.floats(0.01, 100.0))
def test_geometric_force_is_the_inverse(x: float, force: float) -> None:
    tension = geometric_tension(PLAIN, x, force)
    assert force_from_tension(PLAIN, tension, x, "geometric") == pytest.approx(force, rel=1e-6)


def test_the_linear_force_is_the_inverse_and_either_law_is_found_by_its_name() -> None:
    x, force = np.array([0.001, 0.2, 0.649]), np.array([0.0, 2.0, 100.0])
    linear = linear_tension(PLAIN, force)
    np.testing.assert_allclose(force_from_tension(PLAIN, linear), force, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(tension_from_force(PLAIN, force, x), linear)
    np.testing.assert_array_equal(
        tension_from_force(PLAIN, force, x, "geometric"), geometric_tension(PLAIN, x, force)
    )


def test_tension_that_no_press_explains() -> None:
    assert force_from_tension(PLAIN, 67.0) == -1.0
    assert np.isnan(force_from_tension(PLAIN, 67.0, 0.2, "geometric"))
    both = force_from_tension(PLAIN, np.array([67.0, 73.0]), np.array([0.2, 0.2]), "geometric")
    np.testing.assert_array_equal(both, [np.nan, 0.0])


def test_flexible_string_does_not_stretch() -> None:
    assert geometric_tension(FLEXIBLE, 0.2, 3.0) == 65.0


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: force_from_tension(FLEXIBLE, 66.0),
        lambda: force_from_tension(FLEXIBLE, 66.0, 0.2, "geometric"),
        lambda: force_from_tension(PLAIN, 74.0, law="geometric"),
        lambda: tension_from_force(PLAIN, 1.0, law="geometric"),
        lambda: check_law("quadratic"),
    ],
)
def test_what_cannot_tell_force_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
