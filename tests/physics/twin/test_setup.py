"""Sensors, scenes and plans out of range are refused; every preset has a plan within its tolerance."""

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from math import inf, nan
from typing import Any

import numpy as np
import pytest
from tests.physics.twin.built import PLASTIC, SENSOR, STRING, key, touch

from monochord.core.errors import InputError
from monochord.physics.setup import Tolerances
from monochord.physics.strings import load_string, string_names
from monochord.physics.theory import bending_stiffness
from monochord.physics.twin import MAX_TOUCHES, Ebow, Outside, Pickups, Pluck, Scene, Touch, hold, rate

PARTS = (
    Ebow(sense=0.02, drive=0.03), Pickups(), SENSOR, key(0.0, 0.08),
    replace(hold(0.08, 1.0, PLASTIC), radius=0.01),
    Outside(samples=np.zeros(8, np.float32)), Pluck(position=0.07, height=1e-4),
    SENSOR.tolerances, SENSOR.changes,
)  # fmt: skip


def numbers() -> Iterator[tuple[Any, str, int | None]]:
    for part in PARTS:
        for name in (field.name for field in fields(part)):
            value = getattr(part, name)
            if isinstance(value, float):
                yield part, name, None
            elif isinstance(value, tuple):
                yield from ((part, name, place) for place, each in enumerate(value) if type(each) is float)


@pytest.mark.parametrize(("part", "name", "place"), list(numbers()))
def test_every_number_is_refused_where_it_is_not_finite(part: Any, name: str, place: int | None) -> None:
    for value in (nan, inf, -inf):
        old = getattr(part, name)
        new = value if place is None else tuple(value if i == place else x for i, x in enumerate(old))
        with pytest.raises(InputError, match=rf"{type(part).__name__}\.{name}") as caught:
            replace(part, **{name: new})
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("part", "name", "low", "high"),
    [
        (Ebow(sense=0.02, drive=0.03), "gain", -10.0, 10.0),
        (key(0.0, 0.08), "force", 0.0, 10.0),
        (hold(0.08, 1.0, PLASTIC), "radius", 2e-4, 1.0),
        (Outside(samples=np.zeros(8, np.float32)), "level", 0.0, 1e3),
        (Pluck(position=0.07, height=1e-4), "height", -2e-3, 2e-3),
        (Tolerances(), "diameter", 0.0, 0.3),
        (SENSOR, "shake", 0.0, 100.0),
    ],
)
def test_a_number_is_refused_beyond_its_range(part: Any, name: str, low: float, high: float) -> None:
    assert [getattr(replace(part, **{name: value}), name) for value in (low, high)] == [low, high]
    for value in (low - 0.01 * (high - low), high + 0.01 * (high - low)):
        with pytest.raises(InputError, match=rf"{type(part).__name__}\.{name}"):
            replace(part, **{name: value})


def test_three_deviations_of_a_diameter_are_what_the_standard_allows() -> None:
    # ASTM A228 allows a music wire of .010 in 0.3 thousandths of an inch.
    assert 3.0 * Tolerances().diameter == pytest.approx(0.0003 / 0.010)


@pytest.mark.parametrize(
    "change",
    [
        {"length": 0.01},
        {"linear_density": 1.0},
        {"tension": 1.0},
        {"core_diameter": 0.01},
        {"young_modulus": 1e6},
        {"tension_per_force": -1.0},
        {"tension": 500.0, "linear_density": 1e-5},
    ],
)
def test_implausible_strings_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r"sensor built|StringParams\.tension_per_force"):
        replace(SENSOR, string=replace(STRING, **change))


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: replace(SENSOR, range=(0.05, 0.5)), "between 0 and"),
        (lambda: replace(SENSOR, range=(0.15, 0.05)), "start before end"),
        (lambda: replace(SENSOR, drift=40.0), "drift"),
        (lambda: Touch(material=PLASTIC, motion=()), "without keys"),
        (lambda: touch(key(0.1, 0.08), key(0.1, 0.09)), "rising times"),
        (lambda: touch(key(0.0, 0.06), key(1e-3, 0.12)), "5 m/s"),
        (lambda: Scene(touches=(hold(0.08, 1.0, PLASTIC),) * (MAX_TOUCHES + 1)), "8 at most"),
        (lambda: rate.plan(STRING, 44100.0, oversampling=0), "1, 2, 4, 8, 16 or 32"),
        (lambda: rate.padded(257), "256 at most"),
        (
            lambda: rate.plan(
                replace(STRING, core_diameter=3e-3, linear_density=1e-3), 16000.0, oversampling=1
            ),
            "too fast",
        ),
    ],
)
def test_other_things_that_cannot_be_are_refused(make: Callable[[], object], line: str) -> None:
    with pytest.raises(InputError, match=line):
        make()


@pytest.mark.parametrize("name", string_names())
def test_every_preset_has_a_plan_within_the_tolerance(name: str) -> None:
    chosen = rate.plan(load_string(name).string, 44100.0)
    assert chosen.error <= 0.05
    assert rate.padded(chosen.count) >= chosen.count


def test_a_plan_has_the_modes_of_a_hinged_stiff_string_and_shorter_steps_are_more_exact() -> None:
    k = np.arange(1, 5) * np.pi / STRING.length
    square = (STRING.tension * k**2 + bending_stiffness(STRING) * k**4) / STRING.linear_density
    np.testing.assert_allclose(rate.mode_frequencies(STRING, 4), np.sqrt(square))
    assert rate.touch_weights(np.array([1.0, 1e4]), 1e-7, 0.5) == pytest.approx(1.0, abs=1e-6)
    errors = [rate.plan(STRING, 44100.0, oversampling=steps).error for steps in (1, 2, 4)]
    assert errors[0] > errors[1] > errors[2]
