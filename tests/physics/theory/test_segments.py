"""The split string's frequencies: the paper's numbers, symmetry, and the exact inverse."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monochord.core.errors import InputError
from monochord.core.types import Contact, StringParams
from monochord.physics.theory.segments import (
    harmonic_frequencies,
    locate_from_segments,
    mixing_matrix,
    open_frequency,
    position_from_far_segment,
    segment_frequencies,
    split_frequencies,
    step_limit,
    tension_from_segments,
)
from monochord.physics.theory.tension import TensionLaw, force_from_tension, geometric_tension, linear_tension

APPENDIX = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0, tension_per_force=6.0)
PLAIN = StringParams(length=0.65, linear_density=4e-4, tension=73.0, core_diameter=2.54e-4)
FRACTIONS = st.floats(0.01, 0.99)
FORCES = st.floats(0.0, 5.0)


def test_appendix_frequencies_to_a_tenth_of_a_hertz() -> None:
    f1, f2 = segment_frequencies(APPENDIX, Contact(position=0.35 * 0.65, force=0.0))
    assert f1 == pytest.approx(695.0, abs=0.1)
    assert f2 == pytest.approx(374.2, abs=0.1)


def test_harmonics_are_multiples_of_the_first() -> None:
    f = harmonic_frequencies(0.65, 65.0, 6.5e-4, 8)
    np.testing.assert_allclose(f, f[0] * np.arange(1, 9), rtol=1e-15)
    assert f[0] == pytest.approx(np.sqrt(65.0 / 6.5e-4) / 1.3)
    assert f[0] == pytest.approx(open_frequency(APPENDIX), rel=1e-15)


@settings(max_examples=30)
@given(FRACTIONS, FORCES, st.sampled_from(["linear", "geometric"]))
def test_inverse_returns_position_and_force(fraction: float, force: float, law: TensionLaw) -> None:
    string = APPENDIX if law == "linear" else PLAIN
    contact = Contact(position=fraction * string.length, force=force)
    f1, f2 = segment_frequencies(string, contact, law)
    x = locate_from_segments(string.length, f1, f2)
    tension = tension_from_segments(string, f1, f2)
    assert x == pytest.approx(contact.position, rel=1e-12)
    pressed = geometric_tension(string, x, force) if law == "geometric" else linear_tension(string, force)
    assert tension == pytest.approx(pressed, rel=1e-12)
    # The geometric law rises with F^2, so that near F = 0 rounding of T is all that is left of it.
    recovered = force_from_tension(string, max(tension, string.tension), x, law)
    assert recovered == pytest.approx(force, rel=1e-6, abs=1e-4)


@settings(max_examples=30)
@given(FRACTIONS, FORCES, st.sampled_from(["linear", "geometric"]))
def test_mirrored_touch_swaps_the_segments(fraction: float, force: float, law: TensionLaw) -> None:
    x = fraction * PLAIN.length
    f1, f2 = split_frequencies(PLAIN, x, force, law)
    mirrored = split_frequencies(PLAIN, PLAIN.length - x, force, law)
    assert mirrored == pytest.approx((f2, f1), rel=1e-12)


@settings(max_examples=30)
@given(st.floats(0.01, 0.98), st.floats(1e-4, 0.01), FORCES)
def test_trends_of_the_paper(fraction: float, step: float, force: float) -> None:
    here, there = fraction * 0.65, (fraction + step) * 0.65
    f1, f2 = split_frequencies(APPENDIX, here, force)
    moved_1, moved_2 = split_frequencies(APPENDIX, there, force)
    assert moved_1 < f1
    assert moved_2 > f2
    harder_1, harder_2 = split_frequencies(APPENDIX, here, force + 0.1)
    assert harder_1 > f1
    assert harder_2 > f2


def test_arrays_equal_their_elements() -> None:
    x, force = np.array([0.1, 0.2, 0.4]), np.array([0.0, 1.0, 2.0])
    f1, f2 = split_frequencies(PLAIN, x, force, "geometric")
    for i in range(3):
        touch = Contact(position=float(x[i]), force=float(force[i]))
        assert segment_frequencies(PLAIN, touch, "geometric") == pytest.approx((f1[i], f2[i]), rel=1e-14)


@settings(max_examples=30)
@given(st.floats(0.0, 0.95))
def test_far_segment_tells_position(fraction: float) -> None:
    f_open = 82.4
    assert position_from_far_segment(f_open / (1.0 - fraction), f_open, 0.65) == pytest.approx(
        fraction * 0.65, abs=1e-12
    )


@settings(max_examples=30)
@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_mixing_rows_share_out_what_is_heard(own_1: float, own_2: float) -> None:
    mixing = mixing_matrix(own_1, own_2)
    np.testing.assert_allclose(mixing.sum(axis=1), 1.0)
    np.testing.assert_array_equal(np.diag(mixing), [own_1, own_2])


def test_step_limit_is_the_courant_condition() -> None:
    spacing = 0.2275 / 255
    assert step_limit(spacing, 316.0, 0.5) == pytest.approx(0.5 * spacing / 316.0)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: segment_frequencies(APPENDIX, Contact(position=0.0, force=1.0)),
        lambda: segment_frequencies(APPENDIX, Contact(position=0.65, force=1.0)),
        lambda: segment_frequencies(APPENDIX, Contact(position=np.nan, force=1.0)),
        lambda: segment_frequencies(APPENDIX, Contact(position=0.2, force=-1.0)),
        lambda: segment_frequencies(APPENDIX, Contact(position=0.2, force=np.nan)),
        lambda: locate_from_segments(0.65, 100.0, 0.0),
        lambda: mixing_matrix(1.1, 0.5),
        lambda: step_limit(1e-3, 300.0, 1.5),
        lambda: split_frequencies(APPENDIX, 0.1, 0.0, "cubic"),  # pyright: ignore[reportArgumentType]
    ],
)
def test_what_cannot_be_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()


def test_arrays_that_do_not_fit_together_are_refused() -> None:
    with pytest.raises(InputError, match=r"locate from segments.* of one shape"):
        locate_from_segments(0.2, np.ones(3), np.ones(2))
