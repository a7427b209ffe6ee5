"""The rule for labels of known touches, and the force that breaks a wire."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Floats, StringParams
from monochord.physics.known_touches import TouchEstimates, in_newtons, why_impossible
from monochord.physics.strings import load_string, string_names
from monochord.physics.theory import breaking_force, geometric_tension

STRING = load_string("prototype").string
PLACES = np.linspace(0.05, 0.15, 10)[[0, 7, 4, 1, 8, 5, 2, 9, 6, 3]]
FORCES = np.linspace(0.4, 1.6, 10)


def read(
    position_error: float | Floats = 0.0, force: Floats = FORCES, position_std: float = 3e-4
) -> TouchEstimates:
    """Return what a model makes of these touches that is off by so much."""
    return TouchEstimates(PLACES + position_error, np.full(10, position_std), force)


@pytest.mark.parametrize("name", [name for name in string_names() if load_string(name).string.core_diameter])
@pytest.mark.parametrize("share", [0.1, 0.5])
def test_the_breaking_force_is_that_which_brings_the_wire_to_its_strength(name: str, share: float) -> None:
    string = load_string(name).string
    position = share * string.length
    tension = geometric_tension(string, position, breaking_force(string, position))
    assert tension / (0.25 * np.pi * string.core_diameter**2) == pytest.approx(3.0e9)


def test_it_is_least_at_the_middle_and_finite_at_the_ends() -> None:
    force = breaking_force(STRING, np.linspace(0.0, STRING.length, 101))
    assert force.argmin() == 50
    assert 30.0 < force.min() < 50.0
    assert np.isfinite(force).all()
    with pytest.raises(InputError):
        breaking_force(StringParams(length=0.2, linear_density=4e-4, tension=65.0), 0.1)


@pytest.mark.parametrize("string", [None, STRING])
def test_touches_of_a_hand_or_a_gripper_can_be(string: StringParams | None) -> None:
    assert why_impossible(PLACES, FORCES, string) is None
    assert why_impossible(np.array([0.0, 0.2, np.nan]), np.array([np.nan, 1e-3, 10.0]), string) is None


@pytest.mark.parametrize(
    ("position", "force"),
    [(-0.01, 1.0), (0.201, 1.0), (np.inf, 1.0), (0.1, 0.0), (0.1, -1.0), (0.1, 51.0), (0.1, np.inf)],
)
def test_a_place_off_the_string_or_a_force_that_none_bears_cannot(position: float, force: float) -> None:
    wrong = why_impossible(np.array([0.1, position]), np.array([1.0, force]), STRING)
    assert wrong is not None
    assert wrong.touch == 1
    if position == 0.1:  # a force is told without the string, too
        assert why_impossible(np.array([0.1, 0.1]), np.array([1.0, force]), None) is not None


@pytest.mark.parametrize("foreign", [0.66 + FORCES, FORCES - 0.35, 1.8 * FORCES, 0.45 * FORCES])
@pytest.mark.parametrize("error", [0.004, np.linspace(-0.009, 0.009, 10)], ids=["off", "stretched"])
def test_a_foreign_sensor_is_no_contradiction(foreign: Floats, error: float | Floats) -> None:
    assert why_impossible(PLACES, FORCES, STRING, read(error, foreign)) is None


def test_single_touches_that_a_model_misreads_are_none_either() -> None:
    error, force = np.zeros(10), FORCES.copy()
    error[:4], force[:4] = 0.05, 10.0 * FORCES[:4]
    assert why_impossible(PLACES, FORCES, STRING, read(error, force)) is None
    two = TouchEstimates(*(each[:2] for each in read(error, force)))
    assert why_impossible(PLACES[:2], FORCES[:2], STRING, two) is None


@pytest.mark.parametrize(
    ("factor", "unit"), [(1 / 9.80665, "kilograms"), (20.0, ""), (1 / 4.44822, "pounds"), (0.01, "")]
)
def test_a_set_of_forces_in_another_unit_contradicts_the_model(factor: float, unit: str) -> None:
    light = FORCES if factor < 1.0 else 0.2 * FORCES  # so that a string bears what is said
    wrong = why_impossible(PLACES, factor * light, STRING, read(force=1.1 * light))
    assert wrong is not None
    assert wrong.touch is None
    assert unit in wrong.remedy


def test_positions_of_other_touches_contradict_the_model() -> None:
    rolled = why_impossible(np.roll(PLACES, 1), FORCES, STRING, read())
    assert rolled is not None
    assert rolled.touch is None
    assert why_impossible(np.roll(PLACES, 1), FORCES, STRING, read(position_std=0.03)) is None


def test_a_kitchen_scale_shows_a_newton_as_102_grams() -> None:
    assert in_newtons(101.97, "g") == pytest.approx(1.0, rel=1e-4)
    assert in_newtons(1.0, "N") == 1.0
