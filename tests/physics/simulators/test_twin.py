"""The twin asked for a sound."""

import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact
from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.simulators import SIMULATORS, Case, Sound
from monochord.physics.simulators.twin import sensor_of
from monochord.physics.strings import load_string

PROTOTYPE = load_string("prototype")
TOUCH = Contact(position=0.08, force=1.0)


def run(*assignments: str, contact: Contact | None = TOUCH, seconds: float = 0.5) -> Sound:
    case = Case(string=PROTOTYPE.string, contact=contact, seconds=seconds, assignments=assignments)
    return SIMULATORS.build("twin").run(case)


def test_peaks_stand_beside_theory_with_what_is_true() -> None:
    sound = run()
    told = sound.summary
    assert sound.microphones.shape == (2, 22050)
    assert (told["position"], told["force"], told["material"]) == (0.08, 1.0, "plastic")
    assert told["settled"] == 1.0
    assert told["contact"] == pytest.approx(1.0, abs=0.01)
    assert told["felt"] == pytest.approx(1.0, rel=0.05)
    assert told["slip"] < 0.05
    for peak, partial, base in zip(told["peaks"], told["partials"], told["theory"], strict=True):
        # Stiffness, a touch that gives way and the drivers' pull move a segment's line by some per cent.
        assert peak == pytest.approx(partial * base, rel=0.03)


def test_an_untouched_string_has_neither_touch_nor_force() -> None:
    told = run(contact=None).summary
    assert told["theory"] == pytest.approx([1010.565, 1010.565], abs=0.01)
    assert [told[name] for name in ("position", "force", "material", "slip", "felt")] == [None] * 5
    assert told["contact"] == 0.0
    assert told["peaks"][0] == pytest.approx(told["peaks"][1], rel=1e-3)


def test_sliding_is_told() -> None:
    told = run("across=0.02").summary
    assert told["slip"] > 0.9
    assert told["slip_velocity"] == pytest.approx(0.02, rel=0.25)


def test_assignments_reach_every_part_of_the_setup() -> None:
    tighter = run("sensor.string.tension=80", "contact.force=0.5", "material=wood", "seed=3").summary
    assert (tighter["position"], tighter["force"], tighter["material"]) == (0.08, 0.5, "wood")
    plain = run("contact.force=0.5", "material=wood", "seed=3").summary
    # By the square root, but for the press, which stretches a tighter string less.
    assert tighter["theory"][0] == pytest.approx(plain["theory"][0] * (80.0 / 65.0) ** 0.5, rel=1e-3)
    assert tighter["peaks"][0] / tighter["partials"][0] > 1.05 * plain["peaks"][0] / plain["partials"][0]


def test_the_law_of_tension_is_an_option_and_a_part_of_the_setup() -> None:
    case = Case(string=PROTOTYPE.string, contact=Contact(position=0.08, force=2.0), seconds=0.3)
    linear = SIMULATORS.build("twin", {"tension_law": "linear"}).run(case).summary
    assert linear["tension_law"] == "linear"
    assert linear["peaks"] == run("tension_law=linear", "contact.force=2.0", seconds=0.3).summary["peaks"]


def test_a_silent_string_has_no_peak() -> None:
    assert run("drivers=[false, false]", "pluck.height=0", contact=None).summary["peaks"] == [None, None]


def test_a_string_with_a_sensor_gets_it_and_another_one_made_for_it() -> None:
    strings = {load_sensor(name).string: name for name in sensor_names()}
    for string, name in strings.items():
        assert load_sensor(sensor_of(string).name).string == load_sensor(name).string
    for name in ("appendix", "bass_100", "wound_036"):
        string = load_string(name).string
        sensor = sensor_of(string)
        assert sensor.string == string
        for driver, model in zip(sensor.drivers, load_sensor("prototype").drivers, strict=True):
            assert driver.drive / string.length == pytest.approx(model.drive / PROTOTYPE.string.length)


@pytest.mark.parametrize(
    ("assignment", "line"),
    [
        ("contact.positon=0.1", "option 'contact.positon'.*did you mean 'position'"),
        ("contact.position=0.3", "a touch at 0.3 m"),
        ("tension_law=geometrik", "did you mean 'geometric'"),
        ("material=wod", "did you mean 'wood'"),
        ("sensor.pickups.own=[0.5, 0.5]", "hear the ends differently"),
    ],
)
def test_what_cannot_be_is_refused(assignment: str, line: str) -> None:
    with pytest.raises(InputError, match=line):
        run(assignment)


def test_too_short_a_sound_is_refused() -> None:
    with pytest.raises(InputError, match=r"0\.01 to 600 s"):
        run(seconds=0.001)
