"""A place is stated inside the sensing range alone, and not against the window's own lines."""

import dataclasses

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import OUTSIDE_RANGE, Estimate, Estimates, Window
from monochord.perception.model import Model, ModelState, load
from monochord.perception.model.model import WindowReading
from monochord.perception.model.network import UNCERTAIN
from monochord.perception.model.place import CONTRADICTED, NO_PLACE, PlaceByLines, withheld_reason
from monochord.physics.twin.virtual_sensor import VirtualSensor

RANGE = (0.05, 0.15)
RATE = 44100


@pytest.mark.parametrize(
    ("place", "std", "lines", "expected"),
    [
        (0.1, 3e-4, NO_PLACE, ""),
        (0.049, 3e-4, NO_PLACE, OUTSIDE_RANGE),
        (0.151, 3e-4, NO_PLACE, OUTSIDE_RANGE),
        (0.1504, 3e-4, NO_PLACE, ""),
        (0.1504, 3e-4, PlaceByLines(0.1508, 10.0), ""),
        (0.148, 2e-2, NO_PLACE, ""),
        (0.152, 2e-2, NO_PLACE, OUTSIDE_RANGE),
        (0.147, 3e-4, PlaceByLines(0.16, 6.0), OUTSIDE_RANGE),
        (0.147, 3e-4, PlaceByLines(0.12, 6.0), CONTRADICTED),
        (0.147, 3e-4, PlaceByLines(0.16, 1.0), ""),
        (0.147, 3e-4, PlaceByLines(0.1485, 10.0), ""),
        (0.1, 1e-2, PlaceByLines(0.12, 10.0), ""),
    ],
)
def test_lines_that_are_clear_outweigh_a_network(
    place: float, std: float, lines: PlaceByLines, expected: str
) -> None:
    assert withheld_reason(place, std, lines, RANGE) == expected


@pytest.mark.parametrize("place", [0.0513, 0.1487])
def test_a_place_whose_error_reaches_well_outside_is_not_stated(place: float) -> None:
    model, estimates = load("demo"), dict[str, Estimate]()
    for name, value in {"contact": 1.0, "position": place, "force": 1.0, "slip": 0.9}.items():
        estimates[name] = Estimate(value=value, std=1.9e-3, unit="")
    reading = WindowReading(ModelState(), {}, "")
    assert model.withheld(reading, estimates) == (UNCERTAIN, {"position", "force"})
    estimates["position"] = Estimate(value=place, std=3e-4, unit="m")
    assert model.withheld(reading, estimates) == ("", set())


@pytest.mark.parametrize("place", [0.06, 0.14])
def test_the_error_of_a_position_covers_the_length_of_a_real_string(place: float) -> None:
    model = load("demo")
    estimates = {"position": Estimate(value=place, std=3e-4, unit="m"), "force": Estimate.abstain("N", "")}
    stated = model.with_length_error(estimates)
    longer = 0.01 * place / 3.0**0.5  # of lengths that are evenly within 1 % of the design's
    assert stated["position"].std == pytest.approx(np.hypot(3e-4, longer), rel=0.01)
    assert (stated["position"].value, stated["force"]) == (place, estimates["force"])
    own = dataclasses.replace(model.definition, length_std=0.0)
    assert dataclasses.replace(model, definition=own).with_length_error(estimates) == estimates


def test_without_a_range_every_place_is_stated() -> None:
    assert withheld_reason(0.01, 3e-4, NO_PLACE, None) == ""


def touched(place: float, model: Model) -> list[Estimates]:
    """Return the estimates of half a second of a settled touch of 1 N on the design itself, every 0.1 s."""
    twin, state, results = VirtualSensor("prototype", seed=1), ModelState(), list[Estimates]()
    sounds = [twin.advance(2.0)[0]]
    twin.press(place, 1.0)
    sounds.append(twin.advance(0.8)[0])
    sound = np.concatenate(sounds, axis=1).astype(np.float32)
    for start in range(0, sound.shape[1] - 4410, 4410):
        window = Window(samples=sound[:, start : start + 4410], start=start, sample_rate=RATE)
        state, estimates = model.step(state, window)
        results.append(estimates)
    return results[-4:]


@pytest.mark.parametrize("place", [0.042, 0.16])
def test_outside_the_range_contact_alone_is_told(place: float) -> None:
    for estimates in touched(place, load("demo")):
        assert estimates["contact"].valid
        assert estimates["contact"].value > 0.9
        others = {name: each for name, each in estimates.items() if name != "contact"}
        assert {each.reason for each in others.values()} == {OUTSIDE_RANGE}


SOFT = "something very soft seems to touch"


@pytest.mark.parametrize(
    ("detected", "expected", "valid"),
    [
        (SOFT, OUTSIDE_RANGE, {"contact"}),
        ("two things seem to touch", OUTSIDE_RANGE, {"contact"}),
        ("one driver seems silent", OUTSIDE_RANGE, {"contact"}),
        ("microphone 1 is silent", "microphone 1 is silent", set[str]()),
        ("", OUTSIDE_RANGE, {"contact"}),
    ],
)
def test_the_place_comes_before_what_the_touch_sounds_like(
    detected: str, expected: str, valid: set[str]
) -> None:
    touch = Estimate(value=1.0, std=0.001, unit="1")  # 1 m is outside
    estimates: dict[str, Estimate] = dict.fromkeys(("contact", "position", "force", "slip"), touch)
    reading = WindowReading(ModelState(), {}, detected)
    reason, withheld = load("demo").withheld(reading, estimates)
    assert reason == expected
    assert estimates.keys() - withheld == valid


def test_a_narrower_sensor_narrows_what_is_stated() -> None:
    model = load("demo")
    assert all(each["position"].valid for each in touched(0.12, model))
    narrow = model.within((0.05, 0.11))
    assert narrow.places == (0.05, 0.11)
    assert {each["position"].reason for each in touched(0.12, narrow)} == {OUTSIDE_RANGE}


def test_a_wider_sensor_does_not_widen_what_was_learned() -> None:
    assert load("demo").within((0.02, 0.18)).places == RANGE


def test_a_sensor_of_other_places_is_refused() -> None:
    with pytest.raises(InputError) as error:
        load("demo").within((0.16, 0.18))
    assert "160 to 180 mm" in error.value.given


@pytest.mark.parametrize("wrong", [(0.15, 0.05), (0.1, 0.1), (float("nan"), 0.1)])
def test_an_impossible_range_of_a_model_is_refused(wrong: tuple[float, float]) -> None:
    with pytest.raises(InputError):
        dataclasses.replace(load("demo").definition, sensing_range=wrong)
