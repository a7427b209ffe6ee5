"""The foreign sensor of beam elements as physics: partials, segments, order, losses, and what a take is."""

from math import log2, pi

import numpy as np
import pytest
from tests.beam_elements import DENSITY, DIAMETER, MODES, TENSION, YOUNG, Basis, Beam, Object, take
from tests.finite_differences import RATE

from monochord.core.types import Floats, StringParams
from monochord.physics.theory import inharmonicity, open_frequency, stiff_partials, support_shortening

STRING = StringParams(
    length=0.2, linear_density=DENSITY, tension=TENSION, core_diameter=DIAMETER, young_modulus=YOUNG
)
NOTHING = Object(mass=1e-3, mount=10.0)
"""Its own resonance is the lowest of a basis."""
CLAMP = Object(mass=1e3, mount=1e6)


def partials(length: float, count: int) -> Floats:
    f0 = open_frequency(STRING) * STRING.length / length
    return stiff_partials(f0, inharmonicity(STRING, length), np.arange(1.0, count + 1.0))


def lines(elements: int, x: float = 0.1, spring: float = 0.0, thing: Object = NOTHING) -> Floats:
    beam = Beam(length=STRING.length, elements=elements)
    return np.sort(Basis(beam, TENSION, x, spring, thing).omega)[1:] / (2.0 * pi)


def test_the_untouched_string_has_the_partials_of_a_stiff_one() -> None:
    assert lines(120)[:12] == pytest.approx(partials(STRING.length, 12), rel=1e-5)


@pytest.mark.parametrize("x", [0.0537, 0.0737, 0.0912, 0.1283])
def test_a_clamped_string_has_the_partials_of_segments_that_the_support_shortens(x: float) -> None:
    shorter = support_shortening(STRING)
    expected = np.sort(np.concatenate([partials(side - shorter, 4) for side in (x, STRING.length - x)]))[:5]
    assert lines(240, x, 1e10, CLAMP)[:5] == pytest.approx(expected, rel=4e-4)
    plain = np.sort(np.concatenate([partials(side, 4) for side in (x, STRING.length - x)]))[:5]
    assert (lines(240, x, 1e10, CLAMP)[:5] > plain).all()


def test_partials_converge_with_the_fourth_power_of_the_elements_or_faster() -> None:
    exact = partials(STRING.length, 12)[11]
    first, second = (lines(count)[11] - exact for count in (18, 36))
    assert 3.8 < log2(first / second) < 6.2


def test_a_state_that_nothing_drives_dies_away_at_the_rates_of_its_losses() -> None:
    beam = Beam(length=STRING.length)
    basis = Basis(beam, TENSION, 0.1, 0.0, NOTHING)
    over, _ = basis.propagator((12.0, 1e-8), np.zeros((2, len(basis.mass))))
    rates = -np.log(np.abs(np.linalg.eigvals(over))) * RATE
    expected = np.repeat(12.0 + 1e-8 * basis.omega**2, 2)
    assert np.sort(rates) == pytest.approx(np.sort(expected), rel=1e-6)


def test_a_state_stays_what_it_is_in_another_basis() -> None:
    beam = Beam(length=STRING.length)
    free = Basis(beam, TENSION, 0.08, 0.0, Object())
    touched = Basis(beam, TENSION + 0.3, 0.08, 2e4, Object())
    state = np.zeros(2 * MODES)
    state[1:4] = 1e-3, -2e-3, 1e-3
    before, there = free.modes @ state[:MODES], touched.modes @ touched.carried(state, free)[:MODES]
    lost = there - before
    assert lost @ free.mass @ lost < 1e-3 * (before @ free.mass @ before)


@pytest.mark.slow
def test_a_take_is_drawn_by_its_seed_and_sounds_with_every_touch() -> None:
    one, same, other = take(3, 2), take(3, 2), take(4, 2)
    assert np.array_equal(one.sound, same.sound)
    assert one.length != other.length
    assert len(one.touches) == 2
    for known in (one, other, take(3, 1, "geometric")):
        assert known.sound.shape == (2, known.contact.size)
        assert 0.1 < np.abs(known.sound).max() < 0.7
        assert abs(known.length / 0.2 - 1.0) < 0.017
        for first, last in known.touches:
            middle = slice((first + last) // 2, last - 2000)
            assert np.std(known.sound[:, middle], axis=1).min() > 1e-3
            assert np.ptp(known.force[middle]) == 0.0
            assert 0.05 < known.position[first] < 0.15
