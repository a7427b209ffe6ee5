"""Sensors and scenes that cannot be are refused in one line."""

from dataclasses import replace

import pytest
from tests.physics.twin.built import PLASTIC, SENSOR, STRING, key, touch

from monochord.errors import InputError
from monochord.physics.twin import MOST_TOUCHES, Scene, Touch, hold


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
