"""A string against an object, and on a spring."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.special import ellipe, ellipkm1

from monochord.core.errors import InputError
from monochord.core.types import Contact, Floats, StringParams
from monochord.physics.theory import (
    bending_stiffness,
    contact_width,
    hertz_stiffness,
    loaded_frequencies,
    mindlin_ratio,
    outer_diameter,
    static_compliance,
)
from monochord.physics.theory.segments import harmonic_frequencies
from monochord.physics.theory.stiffness import inharmonicity

PLAIN = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0, core_diameter=2.54e-4)
FLEXIBLE = dataclasses.replace(PLAIN, core_diameter=0.0)
HALF = outer_diameter(PLAIN) / 2.0
RADII = st.floats(1e-4, 0.05)


def contact_modulus(young_modulus: float, poisson_ratio: float) -> float:
    return 1.0 / ((1.0 - 0.3**2) / 2.0e11 + (1.0 - poisson_ratio**2) / young_modulus)


def test_outer_diameter_of_a_plain_string_is_its_gauge() -> None:
    assert outer_diameter(PLAIN) == pytest.approx(2.54e-4, rel=1e-3)


def test_equal_crossed_cylinders_touch_like_a_sphere_on_a_plane() -> None:
    modulus = contact_modulus(2e9, 0.35)
    stiffness = hertz_stiffness(PLAIN, HALF, 2e9, 0.35)
    assert stiffness == pytest.approx(4.0 / 3.0 * modulus * math.sqrt(HALF), rel=1e-12)
    circle = 2.0 * (3.0 * HALF * 1.5 / (4.0 * modulus)) ** (1.0 / 3.0)
    assert contact_width(PLAIN, HALF, 2e9, 0.35, 1.5) == pytest.approx(circle, rel=1e-12)


@settings(max_examples=30)
@given(st.floats(1.01, 1e4), st.booleans())
def test_crossed_cylinders_press_by_the_elliptic_integrals(larger: float, thick: bool) -> None:  # noqa: FBT001
    # Johnson (1985), 4.28 to 4.32, with A <= B half the curvatures and a the long axis, e^2 = 1 - (b / a)^2:
    # B / A = ((a / b)^2 E - K) / (K - E), and k2 = 2 pi E* sqrt(K - E) / (3 sqrt(A) e K^1.5).
    radius = HALF * larger if thick else HALF / larger

    def mismatch(flatness: float) -> float:
        k, e = ellipkm1(flatness**2), ellipe(1.0 - flatness**2)
        return float((e / flatness**2 - k) / (k - e) - larger)

    root: Any = brentq(mismatch, 1e-6, 1.0 - 1e-9, xtol=1e-15)
    flatness = float(root)
    k, e = ellipkm1(flatness**2), ellipe(1.0 - flatness**2)
    modulus, curvature = contact_modulus(2e9, 0.35), 0.5 / max(HALF, radius)
    exact = (
        2.0
        * math.pi
        * modulus
        * math.sqrt(k - e)
        / (3.0 * math.sqrt(curvature * (1.0 - flatness**2)) * k**1.5)
    )
    assert hertz_stiffness(PLAIN, radius, 2e9, 0.35) == pytest.approx(exact, rel=1e-6)


@settings(max_examples=30)
@given(RADII)
def test_greater_objects_are_stiffer_and_touch_wider(radius: float) -> None:
    smaller, greater = (hertz_stiffness(PLAIN, r, 2e9, 0.35) for r in (radius, 1.1 * radius))
    assert smaller < greater < 1.1**0.5 * smaller
    assert contact_width(PLAIN, radius, 2e9, 0.35, 1.0) < contact_width(PLAIN, 1.1 * radius, 2e9, 0.35, 1.0)


@settings(max_examples=30)
@given(RADII, st.floats(1e-6, 0.01))
def test_contact_does_not_care_which_cylinder_is_the_string(first: float, second: float) -> None:
    def pressed(half: float, radius: float) -> float:
        string = dataclasses.replace(PLAIN, linear_density=7850.0 * math.pi * half**2)
        return hertz_stiffness(string, radius, 2.0e11, 0.3)

    assert pressed(first, second) == pytest.approx(pressed(second, first), rel=1e-9)


def test_stiffness_goes_with_the_modulus_of_both() -> None:
    stiff, soft = (hertz_stiffness(PLAIN, 5e-3, modulus, 0.3) for modulus in (2e9, 1e5))
    assert stiff / soft == pytest.approx(contact_modulus(2e9, 0.3) / contact_modulus(1e5, 0.3), rel=1e-12)
    rigid = hertz_stiffness(PLAIN, 5e-3, math.inf, 0.3)
    assert rigid == pytest.approx(2.0 * hertz_stiffness(PLAIN, 5e-3, 2e11, 0.3), rel=1e-12)


@settings(max_examples=30)
@given(RADII, st.floats(0.01, 5.0))
def test_hertz_width_goes_with_the_cube_root_of_the_press(radius: float, force: float) -> None:
    # Where the stiff string does not yet lie on the object, the ellipse is all there is.
    force = min(force, 2.0 * math.sqrt(bending_stiffness(PLAIN) * 65.0) / radius / 8.0)
    light, heavy = (contact_width(PLAIN, radius, 2e9, 0.35, press) for press in (force, 8.0 * force))
    assert heavy == pytest.approx(2.0 * light, rel=1e-9)


def test_flexible_string_wraps_and_a_stiff_one_only_when_bent_enough() -> None:
    radius = 20e-3
    onset = 2.0 * math.sqrt(bending_stiffness(PLAIN) * 65.0) / radius
    force = np.array([0.0, 0.9 * onset, onset, 2.0 * onset])
    flexible, stiff = (contact_width(s, radius, 2e9, 0.35, force) for s in (FLEXIBLE, PLAIN))
    assert flexible[0] == stiff[0] == 0.0
    lag = 2.0 * math.sqrt(bending_stiffness(PLAIN) / 65.0)
    expected = np.array([0.0, 0.9 * lag, lag, lag])
    np.testing.assert_allclose(flexible - stiff, expected, rtol=1e-9, atol=1e-15)
    assert stiff[3] > stiff[2] > stiff[1]


def test_width_along_the_string_is_the_long_axis_only_of_an_object_thicker_than_the_string() -> None:
    # Both axes of one ellipse: the string's and the object's radii change places, and so do the axes. Hertz's
    # theory has the ratio of the axes near (ratio of the radii)^(2/3) (Greenwood 1985), which is 4.6 for ten.
    thin = dataclasses.replace(FLEXIBLE, linear_density=7850.0 * math.pi * (0.1 * HALF) ** 2)
    force = 1e-9  # no wrap to speak of
    long = contact_width(thin, HALF, 2.0e11, 0.3, force)
    short = contact_width(FLEXIBLE, 0.1 * HALF, 2.0e11, 0.3, force)
    assert long / short == pytest.approx(10.0 ** (2.0 / 3.0), rel=0.1)


def test_mindlin_ratio() -> None:
    assert mindlin_ratio(0.0) == 1.0
    assert mindlin_ratio(0.5) == pytest.approx(2.0 / 3.0)


LONG = StringParams(length=0.65, linear_density=4e-4, tension=73.0, core_diameter=2.54e-4)
SPEED = np.sqrt(73.0 / 4e-4)
INSIDE = st.floats(0.001, 0.649)
STIFFNESS = st.floats(-3.0, 9.0).map(lambda power: 10.0**power)


def open_series(count: int) -> Floats:
    return harmonic_frequencies(0.65, 73.0, 4e-4, count)


def clamped_series(contact: Contact, count: int) -> Floats:
    near, far = contact.position, 0.65 - contact.position
    both = [harmonic_frequencies(length, 73.0, 4e-4, count) for length in (near, far)]
    return np.sort(np.concatenate(both))[:count]


@settings(max_examples=30)
@given(INSIDE, STIFFNESS)
def test_each_frequency_solves_the_equation_to_its_last_digits(x: float, stiffness: float) -> None:
    # The equation without its poles has opposite signs a relative 1e-12 below and above each root.
    frequency = loaded_frequencies(LONG, x, stiffness, 12)

    def balance(f: Floats) -> Floats:
        w = 2.0 * np.pi * f / SPEED
        spring = stiffness * np.sin(w * x) * np.sin(w * (0.65 - x))
        return 73.0 * w * np.sin(w * 0.65) + spring

    below, above = balance(frequency * (1.0 - 1e-12)), balance(frequency * (1.0 + 1e-12))
    blurred = np.diff(frequency, append=np.inf) < 1e-9 * frequency
    blurred |= np.diff(frequency, prepend=0.0) < 1e-9 * frequency
    assert np.all((below * above <= 0.0) | blurred)


@settings(max_examples=30)
@given(INSIDE, STIFFNESS)
def test_each_frequency_lies_between_the_untouched_and_the_clamped(x: float, stiffness: float) -> None:
    frequency = loaded_frequencies(LONG, x, stiffness, 12)
    assert np.all(frequency >= open_series(12) * (1.0 - 1e-14))
    assert np.all(frequency <= clamped_series(Contact(position=x, force=0.0), 12) * (1.0 + 1e-14))


@settings(max_examples=30)
@given(INSIDE, STIFFNESS, st.floats(1.01, 10.0))
def test_a_stiffer_spring_never_sounds_lower(x: float, stiffness: float, ratio: float) -> None:
    soft = loaded_frequencies(LONG, x, stiffness, 8)
    assert np.all(loaded_frequencies(LONG, x, ratio * stiffness, 8) >= soft * (1.0 - 1e-14))


@settings(max_examples=30)
@given(INSIDE)
def test_no_spring_is_the_open_string_and_an_infinite_one_a_clamp(x: float) -> None:
    np.testing.assert_allclose(loaded_frequencies(LONG, x, 0.0, 9), open_series(9), rtol=1e-14)
    clamped = clamped_series(Contact(position=x, force=0.0), 9)
    np.testing.assert_allclose(loaded_frequencies(LONG, x, np.inf, 9), clamped, rtol=1e-14)


def test_middle_reduces_to_a_tangent() -> None:
    # At the middle the odd modes solve tan(u) = -4 T u / (K L), u = w L / (2 c), and the even ones stay.
    frequency = loaded_frequencies(LONG, 0.325, 500.0, 6)
    u = np.pi * frequency[::2] * 0.65 / SPEED
    np.testing.assert_allclose(np.tan(u), -4.0 * 73.0 * u / (500.0 * 0.65), rtol=1e-12)
    np.testing.assert_allclose(frequency[1::2], open_series(6)[1::2], rtol=1e-14)


def test_a_mode_with_its_node_at_the_spring_stays() -> None:
    for stiffness in (1.0, 1e4, np.inf):
        third = loaded_frequencies(LONG, 0.65 / 3.0, stiffness, 6)[[2, 5]]
        np.testing.assert_allclose(third, open_series(6)[[2, 5]], rtol=1e-14)


def test_light_spring_shifts_as_perturbation_theory_says() -> None:
    # w_n^2 rises by K phi_n^2 / (mu L / 2) to first order.
    x, stiffness = 0.2, 1e-3
    number = np.arange(1, 7)
    rise = stiffness * np.sin(number * np.pi * x / 0.65) ** 2 / (4e-4 * 0.65 / 2.0)
    shift = (2.0 * np.pi) ** 2 * (loaded_frequencies(LONG, x, stiffness, 6) ** 2 - open_series(6) ** 2)
    np.testing.assert_allclose(shift, rise, rtol=1e-5, atol=1e-5)


@settings(max_examples=30)
@given(INSIDE, st.floats(1e-5, 3e-3))
def test_compliance_is_the_sum_over_hinged_modes(x: float, diameter: float) -> None:
    string = dataclasses.replace(LONG, core_diameter=diameter)
    k = np.arange(1, 20001) * np.pi / 0.65
    modes = np.sin(k * x) ** 2 / (73.0 * k**2 + bending_stiffness(string) * k**4)
    # What is left out is at most the sum of 2 L / (pi^2 T n^2) over n > 20000.
    left_out = 2.0 * 0.65 / (np.pi**2 * 73.0 * 20000)
    assert static_compliance(string, x) == pytest.approx(2.0 / 0.65 * modes.sum(), rel=1e-9, abs=left_out)


def test_compliance_of_a_flexible_string_and_of_a_beam() -> None:
    flexible = dataclasses.replace(LONG, core_diameter=0.0)
    assert static_compliance(flexible, 0.2) == pytest.approx(0.2 * 0.45 / (73.0 * 0.65), rel=1e-15)
    almost = dataclasses.replace(LONG, core_diameter=1e-9)
    assert static_compliance(almost, 0.2) == pytest.approx(static_compliance(flexible, 0.2), rel=1e-9)
    # a L = 0.14: a beam with L^3 / (48 E I), which the tension stiffens by (a L / pi)^2 for a half sine.
    beam = dataclasses.replace(LONG, core_diameter=0.02)
    bent = 0.65**3 / (48.0 * bending_stiffness(beam))
    tightened = bent / (1.0 + 73.0 * 0.65**2 / (np.pi**2 * bending_stiffness(beam)))
    assert static_compliance(beam, 0.325) == pytest.approx(tightened, rel=1e-4)


def test_compliance_takes_arrays_and_is_symmetric() -> None:
    x = np.array([0.001, 0.2, 0.45, 0.649])
    compliance = static_compliance(LONG, x)
    assert compliance.shape == (4,)
    np.testing.assert_allclose(compliance, compliance[::-1], rtol=1e-12)
    assert isinstance(static_compliance(LONG, 0.2), float)


def test_bending_stiffness_is_that_of_inharmonicity() -> None:
    assert np.pi**2 * bending_stiffness(LONG) / (73.0 * 0.65**2) == pytest.approx(inharmonicity(LONG))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: hertz_stiffness(PLAIN, math.inf, 2e9, 0.3),
        lambda: contact_width(PLAIN, 0.0, 2e9, 0.3, 1.0),
        lambda: hertz_stiffness(PLAIN, 5e-3, -1.0, 0.3),
        lambda: hertz_stiffness(PLAIN, 5e-3, 2e9, 0.6),
        lambda: mindlin_ratio(math.nan),
        lambda: contact_width(PLAIN, 5e-3, 2e9, 0.3, -1.0),
        lambda: outer_diameter(dataclasses.replace(PLAIN, linear_density=0.0)),
        lambda: loaded_frequencies(LONG, 0.65, 1.0, 3),
        lambda: loaded_frequencies(LONG, 0.2, -1.0, 3),
        lambda: loaded_frequencies(LONG, 0.2, np.nan, 3),
        lambda: loaded_frequencies(LONG, 0.2, 1.0, 0),
        lambda: static_compliance(LONG, 0.0),
        lambda: bending_stiffness(dataclasses.replace(LONG, young_modulus=0.0)),
    ],
)
def test_what_makes_no_sense_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
