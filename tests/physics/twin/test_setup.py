"""Sensors, scenes and plans out of range are refused; every preset has a plan within its tolerance."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import inf, nan
from typing import Any

import numpy as np
import pytest
from tests.physics.twin.built import PLASTIC, SENSOR, STRING, key, touch

from monochord.core.errors import InputError
from monochord.physics.strings import load_string, string_names
from monochord.physics.theory import bending_stiffness
from monochord.physics.twin import MAX_TOUCHES, Ebow, Outside, Pickups, Pluck, Scene, Touch, hold, rate
from monochord.physics.twin.setup import FINITE, Tolerances, _ranges

PARTS = (
    Ebow(sense=0.02, drive=0.03), Pickups(), SENSOR, key(0.0, 0.08), hold(0.08, 1.0, PLASTIC),
    Outside(samples=np.zeros(8, np.float32)), Pluck(position=0.07, height=1e-4),
    SENSOR.tolerances, SENSOR.changes,
)  # fmt: skip


def with_value(part: Any, name: str, place: int | None, value: float) -> Any:
    """The part with one of its numbers changed; tolerances are checked by their sensor."""
    old = getattr(part, name)
    new = value if place is None else tuple(value if i == place else x for i, x in enumerate(old))
    changed = replace(part, **{name: new})
    for field in ("tolerances", "changes"):
        if part is getattr(SENSOR, field):
            replace(SENSOR, **{field: changed})
    return changed


def numbers() -> Iterator[tuple[Any, str, int | None, float, float]]:
    for part in PARTS:
        yield from ((part, *limits) for limits in _ranges(type(part)))


@pytest.mark.parametrize(("part", "name", "place", "low", "high"), list(numbers()))
def test_every_number_is_refused_beyond_its_range_and_where_it_is_not_finite(
    part: Any, name: str, place: int | None, low: float, high: float
) -> None:
    beyond = [] if high == FINITE else [high + 0.01 * (high - low), low - 0.01 * (high - low)]
    for value in (nan, inf, -inf, *beyond):
        with pytest.raises(InputError, match=f"{type(part).__name__} {name}"):
            with_value(part, name, place, value)
    if high < FINITE and part is not SENSOR and not isinstance(part, Touch):
        assert with_value(part, name, place, low) != with_value(part, name, place, high)


def test_ranges_are_those_that_the_annotations_state() -> None:
    stated = {(type(part).__name__, name, low, high) for part, name, _, low, high in numbers()}
    assert {
        ("Ebow", "gain", -10.0, 10.0), ("Pickups", "own", 0.0, 1.0), ("Sensor", "drift", -50.0, 50.0),
        ("Key", "force", 0.0, 10.0), ("Touch", "radius", 2e-4, 1.0), ("Outside", "level", 0.0, 1e3),
        ("Pluck", "height", -2e-3, 2e-3), ("Tolerances", "diameter", 0.0, 0.3),
        ("Key", "time", -FINITE, FINITE),
    } <= stated  # fmt: skip
    # ASTM A228 allows a music wire of .010 in 0.3 thousandths of an inch: three standard deviations.
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
    with pytest.raises(InputError, match="sensor built"):
        replace(SENSOR, string=replace(STRING, **change))


@pytest.mark.parametrize(
    "make",
    [
        lambda: replace(SENSOR, range=(0.05, 0.5)),
        lambda: replace(SENSOR, range=(0.15, 0.05)),
        lambda: replace(SENSOR, drift=40.0),
        lambda: Touch(material=PLASTIC, motion=()),
        lambda: touch(key(0.1, 0.08), key(0.1, 0.09)),
        lambda: touch(key(0.0, 0.06), key(1e-3, 0.12)),
        lambda: Scene(touches=(hold(0.08, 1.0, PLASTIC),) * (MAX_TOUCHES + 1)),
        lambda: rate.plan(STRING, 44100.0, oversampling=0),
        lambda: rate.padded(257),
    ],
)
def test_other_things_that_cannot_be_are_refused(make: Callable[[], object]) -> None:
    with pytest.raises(InputError):
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
