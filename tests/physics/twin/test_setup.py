"""Sensors and scenes that cannot be are refused in one line."""

from dataclasses import fields, replace
from math import inf, nan
from typing import Any, get_type_hints

import numpy as np
import pytest
from tests.physics.twin.built import PLASTIC, SENSOR, STRING, key, touch

from monochord.core.errors import InputError
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import MOST_TOUCHES, Ebow, Outside, Pickups, Pluck, Scene, Touch, hold

EBOW, PICKUPS, TOUCH = Ebow(sense=0.02, drive=0.03), Pickups(), hold(0.08, 1.0, PLASTIC)
OUTSIDE = Outside(samples=np.zeros(8, np.float32))
PLUCK = Pluck(position=0.07, height=1e-4)
BEYOND: list[tuple[Any, str, Any, str]] = [
    (EBOW, "aperture", 0.06, "0 to 0.05"),
    (EBOW, "centre", 10.0, "20 to 12000"),
    (EBOW, "quality", 0.0, "0.1 to 20"),
    (EBOW, "gain", 1e9, "-10 to 10"),
    (EBOW, "limit", -0.1, "0 to 1"),
    (EBOW, "angle", 4.0, "-3.14159 to 3.14159"),
    (PICKUPS, "own", (0.5, 1.5), "0 to 1"),
    (PICKUPS, "gain", (-1.0, 0.5), "0 to 10000"),
    (PICKUPS, "angle", -4.0, "-3.14159 to 3.14159"),
    (PICKUPS, "low", 0.5, "1 to 1000"),
    (PICKUPS, "high", 30000.0, "1000 to 20000"),
    (PICKUPS, "hiss", 0.2, "0 to 0.1"),
    (SENSOR, "drift", 60.0, "-50 to 50"),
    (SENSOR, "drift_rate", 2.0, "-1 to 1"),
    (SENSOR, "shake", -1.0, "0 to 100"),
    (SENSOR, "frame_expansion", 1.0, "0 to 0.0001"),
    (SENSOR, "string_expansion", -1.0, "0 to 0.0001"),
    (key(0.0, 0.08), "force", -1.0, "0 to 10"),
    (key(0.0, 0.08), "clearance", 0.2, "0 to 0.1"),
    (key(0.0, 0.08), "across", 0.6, "-0.5 to 0.5"),
    (TOUCH, "radius", 1e-4, "0.0002 to 1"),
    (OUTSIDE, "level", 2e3, "0 to 1000"),
    (PLUCK, "height", -3e-3, "-0.002 to 0.002"),
]
"""A part, its field, a value outside that field's range, and the range."""
FREE: list[tuple[Any, str]] = [
    (EBOW, "sense"),
    (EBOW, "drive"),
    (PICKUPS, "air"),
    (key(0.0, 0.08), "time"),
    (key(0.0, 0.08), "position"),
    (PLUCK, "position"),
    (PLUCK, "angle"),
]
"""A part and a field that any finite number suits."""


@pytest.mark.parametrize(("part", "name", "value", "allowed"), BEYOND)
def test_numbers_out_of_range_are_refused_in_one_line(part: Any, name: str, value: Any, allowed: str) -> None:
    with pytest.raises(InputError) as caught:
        replace(part, **{name: value})
    line = str(caught.value)
    assert line.startswith(f"{type(part).__name__} {name}")
    assert line.endswith(f"allowed is {allowed}")
    assert "\n" not in line


@pytest.mark.parametrize("value", [nan, inf, -inf])
@pytest.mark.parametrize(("part", "name"), [*((part, name) for part, name, *_ in BEYOND), *FREE])
def test_what_is_not_finite_is_refused(part: Any, name: str, value: float) -> None:
    pair = isinstance(getattr(part, name), tuple)
    with pytest.raises(InputError, match=f"{name}.* (nan|-?inf): allowed is"):
        replace(part, **{name: (0.5, value) if pair else value})


def test_every_range_is_tried() -> None:
    for part in (EBOW, PICKUPS, SENSOR, key(0.0, 0.08), TOUCH, OUTSIDE, PLUCK):
        hints = get_type_hints(type(part), include_extras=True)
        ranged = {one.name for one in fields(part) if "Meta(" in str(hints[one.name])}
        assert ranged == {name for tried, name, *_ in BEYOND if type(tried) is type(part)}


def test_both_ends_of_a_range_are_allowed() -> None:
    assert [replace(EBOW, gain=gain).gain for gain in (-10.0, 10.0)] == [-10.0, 10.0]
    assert [replace(TOUCH, radius=radius).radius for radius in (None, 2e-4, 1.0)] == [None, 2e-4, 1.0]
    assert replace(PICKUPS, own=(0.0, 1.0)).own == (0.0, 1.0)


def test_tolerances_of_a_sensor_are_in_range_too() -> None:
    design = load_sensor("prototype")
    with pytest.raises(InputError, match=r"Tolerances diameter 0\.5: allowed is 0 to 0\.3"):
        replace(design, tolerances=replace(design.tolerances, diameter=0.5))
    with pytest.raises(InputError, match="Changes gain nan"):
        replace(design, changes=replace(design.changes, gain=nan))


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
def test_strings_that_cannot_be(change: dict[str, float]) -> None:
    with pytest.raises(InputError, match="sensor built"):
        replace(SENSOR, string=replace(STRING, **change))


def test_places_off_the_string_and_too_much_drift() -> None:
    with pytest.raises(InputError, match="between 0 and"):
        replace(SENSOR, range=(0.05, 0.5))
    with pytest.raises(InputError, match="start before end"):
        replace(SENSOR, range=(0.15, 0.05))
    with pytest.raises(InputError, match="drift"):
        replace(SENSOR, drift=40.0)


def test_motions_that_cannot_be() -> None:
    with pytest.raises(InputError, match="without keys"):
        Touch(material=PLASTIC, motion=())
    with pytest.raises(InputError, match="rising times"):
        touch(key(0.1, 0.08), key(0.1, 0.09))
    with pytest.raises(InputError, match="5 m/s"):
        touch(key(0.0, 0.06), key(1e-3, 0.12))
    with pytest.raises(InputError, match="8 at most"):
        Scene(touches=tuple(hold(0.08, 1.0, PLASTIC) for _ in range(MOST_TOUCHES + 1)))
