import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monochord.core.units import cents, decibels

frequencies = st.floats(1.0, 1e5)
ratios = st.floats(1e-10, 1e10)


def test_an_octave_is_1200_cents_and_an_equal_tempered_semitone_100() -> None:
    assert cents(110.0, 220.0) == pytest.approx(1200.0)
    assert cents(440.0, 440.0 * 2 ** (1 / 12)) == pytest.approx(100.0)


@given(frequencies, frequencies, frequencies)
def test_intervals_add(low: float, middle: float, high: float) -> None:
    assert cents(low, middle) + cents(middle, high) == pytest.approx(cents(low, high), abs=1e-6)


@given(frequencies, frequencies)
def test_an_interval_back_is_its_negative(one: float, other: float) -> None:
    assert cents(one, other) == pytest.approx(-cents(other, one), abs=1e-9)


@given(ratios, ratios)
def test_decibels_of_a_product_add(one: float, other: float) -> None:
    assert decibels(one * other) == pytest.approx(decibels(one) + decibels(other), abs=1e-9)


@pytest.mark.parametrize(("ratio", "level"), [(1.0, 0.0), (0.1, -20.0), (math.sqrt(2), 3.0103)])
def test_known_levels(ratio: float, level: float) -> None:
    assert decibels(ratio) == pytest.approx(level, abs=1e-4)


def test_silence_is_minus_infinity() -> None:
    assert decibels(0.0) == -math.inf
