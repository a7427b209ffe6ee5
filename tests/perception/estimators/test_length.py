"""A model on a sensor whose string is not as long as its design's."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tests.perception.windows import RATE, SIZE, cut
from tests.twins import sound_of

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal
from monochord.perception.model import Model, load
from monochord.perception.model.stream import ModelStream
from monochord.physics.sensors import Sensor, load_sensor, with_sensor
from monochord.physics.setup import lengthened
from monochord.physics.theory import open_frequency
from monochord.physics.twin.virtual_sensor import VirtualSensor

DESIGN = load_sensor("prototype")
SHORTER = lengthened(DESIGN, 0.99)
MEASURED = replace(SHORTER, measured_length=SHORTER.string.length)
"""The same, known to its user."""
FORCE = 0.8


@cache
def touched() -> tuple[Audio, tuple[float, ...]]:
    """Return the sound of a string of 198 mm at rest and touched at a few places, and these places in m."""
    places = tuple(share * SHORTER.string.length for share in (0.35, 0.45, 0.5, 0.6))
    steps = (step for place in places for step in (0.8, (place, FORCE), 0.8, None))
    return sound_of(VirtualSensor(SHORTER, seed=3), *steps)[0], places


def stream(sensor: Sensor) -> ModelStream:
    return load("demo").stream(with_sensor(Signal(sample_rate=RATE, channels=2), sensor), SIZE)


def stated(sensor: Sensor) -> tuple[Floats, Floats, Floats]:
    """Return the error and the standard error of position in each touch in m, and the force in N."""
    sound, places = touched()
    estimate = stream(sensor)
    rows = [estimate(window) for window in cut(sound)]
    last = [rows[round(1.6 * (number + 1) * RATE) // SIZE - 2] for number in range(len(places))]
    assert all(each["position"].valid and each["force"].valid for each in last)
    error, std, force = (
        np.array([getattr(each[name], part) for each in last])
        for name, part in (("position", "value"), ("position", "std"), ("force", "value"))
    )
    return error - places, std, force


def test_a_known_length_puts_touches_where_they_are() -> None:
    unknown, covered, _ = stated(DESIGN)
    assert unknown[2] == pytest.approx(1e-3, abs=0.3e-3)  # at the middle, (L0 - L) / 2
    assert (np.abs(unknown) < 3.0 * covered).all()
    known, std, _ = stated(MEASURED)
    assert np.abs(known).max() < 0.3e-3
    assert (np.abs(known) < 3.0 * std).all()


def test_a_known_length_lowers_the_stated_errors() -> None:
    (_, unknown, _), (_, known, _) = stated(DESIGN), stated(MEASURED)
    assert (known < 0.7 * unknown).all()


def test_forces_are_those_of_the_shorter_string() -> None:
    """At its pitch the string has less tension: 0.98 of it, so the same rise is of 0.97 of the force."""
    (_, _, unknown), (_, _, known) = stated(DESIGN), stated(MEASURED)
    np.testing.assert_allclose(known / unknown, 0.99**3, rtol=1e-3)


def test_features_and_all_else_are_those_of_the_pitch() -> None:
    sound, _ = touched()
    of_design, of_own = stream(DESIGN), stream(MEASURED)
    for window in cut(sound[:, : 2 * RATE]):
        one, other = of_design(window)["contact"], of_own(window)["contact"]
        assert other.value == pytest.approx(one.value, nan_ok=True, abs=1e-4)


def own_model(sensor: Sensor) -> Model:
    model = load("demo").tuned(sensor.string)
    return model.within(sensor.range)


def test_a_sensor_keeps_the_range_that_it_states_and_the_trainings_scales() -> None:
    places = own_model(MEASURED).places
    assert places is not None
    own = np.array(places) * own_model(MEASURED).prepared.length_scale
    # The design's range is the training's: on a shorter string it ends where the training's does.
    np.testing.assert_allclose(own, (0.05, 0.15 * 0.99))


def test_the_same_length_gives_the_same_bits_and_the_rulers_error() -> None:
    model = load("demo")
    assert model.tuned(DESIGN.string) is model
    same = replace(DESIGN, measured_length=DESIGN.string.length)
    sound, _ = touched()
    one, other = stream(DESIGN), stream(same)
    for window in cut(sound[:, : 2 * RATE]):
        first, second = one(window), other(window)
        assert repr(first["force"]) == repr(second["force"])
        if first["position"].valid:
            assert first["position"].value == second["position"].value
            assert first["position"].std > second["position"].std


def test_a_model_keeps_the_pitch_of_a_longer_string_that_is_tuned_otherwise() -> None:
    longer = lengthened(DESIGN, 1.02)
    lower = replace(longer.string, tension=0.9 * longer.string.tension)
    own = load("demo").tuned(lower).string
    assert own is not None
    assert own.length == pytest.approx(0.204)
    assert open_frequency(own) == pytest.approx(open_frequency(lower))


def test_another_string_is_refused() -> None:
    with pytest.raises(InputError, match=r"0\.208 m.*0\.2 m within 3 %.*train a model"):
        stream(lengthened(DESIGN, 1.04))
