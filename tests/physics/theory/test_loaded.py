"""A string on a spring: the equation, its limits, and the give of a stiff string summed over its modes."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monochord.core.errors import InputError
from monochord.core.types import Contact, Floats, StringParams
from monochord.physics.theory.loaded import bending_stiffness, loaded_frequencies, static_compliance
from monochord.physics.theory.segments import harmonic_frequencies
from monochord.physics.theory.stiffness import inharmonicity

PLAIN = StringParams(length=0.65, linear_density=4e-4, tension=73.0, core_diameter=2.54e-4)
SPEED = np.sqrt(73.0 / 4e-4)
INSIDE = st.floats(0.001, 0.649)
STIFFNESS = st.floats(-3.0, 9.0).map(lambda power: 10.0**power)


def open_series(count: int) -> Floats:
    return harmonic_frequencies(0.65, 73.0, 4e-4, count)


def clamped_series(contact: Contact, count: int) -> Floats:
    near, far = contact.position, 0.65 - contact.position
    both = [harmonic_frequencies(length, 73.0, 4e-4, count) for length in (near, far)]
    return np.sort(np.concatenate(both))[:count]


@given(INSIDE, STIFFNESS)
def test_each_frequency_solves_the_equation_to_its_last_digits(x: float, stiffness: float) -> None:
    # The equation without its poles has opposite signs a relative 1e-12 below and above each root.
    frequency = loaded_frequencies(PLAIN, x, stiffness, 12)

    def balance(f: Floats) -> Floats:
        w = 2.0 * np.pi * f / SPEED
        spring = stiffness * np.sin(w * x) * np.sin(w * (0.65 - x))
        return 73.0 * w * np.sin(w * 0.65) + spring

    below, above = balance(frequency * (1.0 - 1e-12)), balance(frequency * (1.0 + 1e-12))
    blurred = np.diff(frequency, append=np.inf) < 1e-9 * frequency
    blurred |= np.diff(frequency, prepend=0.0) < 1e-9 * frequency
    assert np.all((below * above <= 0.0) | blurred)


@given(INSIDE, STIFFNESS)
def test_each_frequency_lies_between_the_untouched_and_the_clamped(x: float, stiffness: float) -> None:
    frequency = loaded_frequencies(PLAIN, x, stiffness, 12)
    assert np.all(frequency >= open_series(12) * (1.0 - 1e-14))
    assert np.all(frequency <= clamped_series(Contact(position=x, force=0.0), 12) * (1.0 + 1e-14))


@given(INSIDE, STIFFNESS, st.floats(1.01, 10.0))
def test_a_stiffer_spring_never_sounds_lower(x: float, stiffness: float, ratio: float) -> None:
    soft = loaded_frequencies(PLAIN, x, stiffness, 8)
    assert np.all(loaded_frequencies(PLAIN, x, ratio * stiffness, 8) >= soft * (1.0 - 1e-14))


@given(INSIDE)
def test_no_spring_is_the_open_string_and_an_infinite_one_a_clamp(x: float) -> None:
    np.testing.assert_allclose(loaded_frequencies(PLAIN, x, 0.0, 9), open_series(9), rtol=1e-14)
    clamped = clamped_series(Contact(position=x, force=0.0), 9)
    np.testing.assert_allclose(loaded_frequencies(PLAIN, x, np.inf, 9), clamped, rtol=1e-14)


def test_middle_reduces_to_a_tangent() -> None:
    # At the middle the odd modes solve tan(u) = -4 T u / (K L), u = w L / (2 c), and the even ones stay.
    frequency = loaded_frequencies(PLAIN, 0.325, 500.0, 6)
    u = np.pi * frequency[::2] * 0.65 / SPEED
    np.testing.assert_allclose(np.tan(u), -4.0 * 73.0 * u / (500.0 * 0.65), rtol=1e-12)
    np.testing.assert_allclose(frequency[1::2], open_series(6)[1::2], rtol=1e-14)


def test_a_mode_with_its_node_at_the_spring_stays() -> None:
    for stiffness in (1.0, 1e4, np.inf):
        third = loaded_frequencies(PLAIN, 0.65 / 3.0, stiffness, 6)[[2, 5]]
        np.testing.assert_allclose(third, open_series(6)[[2, 5]], rtol=1e-14)


def test_light_spring_shifts_as_perturbation_theory_says() -> None:
    # w_n^2 rises by K phi_n^2 / (mu L / 2) to first order.
    x, stiffness = 0.2, 1e-3
    number = np.arange(1, 7)
    rise = stiffness * np.sin(number * np.pi * x / 0.65) ** 2 / (4e-4 * 0.65 / 2.0)
    shift = (2.0 * np.pi) ** 2 * (loaded_frequencies(PLAIN, x, stiffness, 6) ** 2 - open_series(6) ** 2)
    np.testing.assert_allclose(shift, rise, rtol=1e-5, atol=1e-5)


@given(INSIDE, st.floats(1e-5, 3e-3))
def test_compliance_is_the_sum_over_hinged_modes(x: float, diameter: float) -> None:
    string = dataclasses.replace(PLAIN, core_diameter=diameter)
    k = np.arange(1, 20001) * np.pi / 0.65
    modes = np.sin(k * x) ** 2 / (73.0 * k**2 + bending_stiffness(string) * k**4)
    # What is left out is at most the sum of 2 L / (pi^2 T n^2) over n > 20000.
    left_out = 2.0 * 0.65 / (np.pi**2 * 73.0 * 20000)
    assert static_compliance(string, x) == pytest.approx(2.0 / 0.65 * modes.sum(), rel=1e-9, abs=left_out)


def test_compliance_of_a_flexible_string_and_of_a_beam() -> None:
    flexible = dataclasses.replace(PLAIN, core_diameter=0.0)
    assert static_compliance(flexible, 0.2) == pytest.approx(0.2 * 0.45 / (73.0 * 0.65), rel=1e-15)
    almost = dataclasses.replace(PLAIN, core_diameter=1e-9)
    assert static_compliance(almost, 0.2) == pytest.approx(static_compliance(flexible, 0.2), rel=1e-9)
    # a L = 0.14: a beam with L^3 / (48 E I), which the tension stiffens by (a L / pi)^2 for a half sine.
    beam = dataclasses.replace(PLAIN, core_diameter=0.02)
    bent = 0.65**3 / (48.0 * bending_stiffness(beam))
    tightened = bent / (1.0 + 73.0 * 0.65**2 / (np.pi**2 * bending_stiffness(beam)))
    assert static_compliance(beam, 0.325) == pytest.approx(tightened, rel=1e-4)


def test_compliance_takes_arrays_and_is_symmetric() -> None:
    x = np.array([0.001, 0.2, 0.45, 0.649])
    compliance = static_compliance(PLAIN, x)
    assert compliance.shape == (4,)
    np.testing.assert_allclose(compliance, compliance[::-1], rtol=1e-12)
    assert isinstance(static_compliance(PLAIN, 0.2), float)


def test_spring_and_string_agree_where_the_string_only_gives() -> None:
    # Far below the first frequency the string itself is a spring: T L / (x (L - x)) newtons a metre.
    x, stiffness = 0.2, 1e9
    flexible = dataclasses.replace(PLAIN, core_diameter=0.0)
    assert 1.0 / static_compliance(flexible, x) == pytest.approx(73.0 / x + 73.0 / (0.65 - x))
    clamped = clamped_series(Contact(position=x, force=0.0), 1)[0]
    gap = 1.0 - loaded_frequencies(PLAIN, x, stiffness, 1)[0] / clamped
    assert 0.0 < gap < 1.0 / (stiffness * static_compliance(flexible, x))


def test_bending_stiffness_is_that_of_inharmonicity() -> None:
    assert np.pi**2 * bending_stiffness(PLAIN) / (73.0 * 0.65**2) == pytest.approx(inharmonicity(PLAIN))


def test_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(InputError, match=r"strictly between 0 and 0\.65 m"):
        loaded_frequencies(PLAIN, 0.65, 1.0, 3)
    with pytest.raises(InputError, match="stiffness -1 N/m"):
        loaded_frequencies(PLAIN, 0.2, -1.0, 3)
    with pytest.raises(InputError, match="stiffness nan"):
        loaded_frequencies(PLAIN, 0.2, np.nan, 3)
    with pytest.raises(InputError, match="count 0"):
        loaded_frequencies(PLAIN, 0.2, 1.0, 0)
    with pytest.raises(InputError, match="strictly between"):
        static_compliance(PLAIN, 0.0)
    with pytest.raises(InputError, match="young modulus 0"):
        bending_stiffness(dataclasses.replace(PLAIN, young_modulus=0.0))
