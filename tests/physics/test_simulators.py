"""Models: peaks beside theory, assignments that reach every part, one line for what is wrong."""

from collections.abc import Callable
from functools import cache
from typing import Any

import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact
from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.simulators import SIMULATORS, Case, Sound
from monochord.physics.simulators.twin import sensor_of
from monochord.physics.strings import load_string

APPENDIX, PROTOTYPE = load_string("appendix"), load_string("prototype")
TOUCH = Contact(position=0.08, force=1.0)


@cache
def split(*assignments: str, contact: Contact | None = APPENDIX.contact) -> Sound:
    case = Case(string=APPENDIX.string, contact=contact, seconds=0.4, assignments=assignments)
    return SIMULATORS.build("split_string", {"route": "modal"}).run(case)


@cache
def twin(*assignments: str, contact: Contact | None = TOUCH, seconds: float = 0.5, **options: Any) -> Sound:
    case = Case(string=PROTOTYPE.string, contact=contact, seconds=seconds, assignments=assignments)
    return SIMULATORS.build("twin", options).run(case)


def test_split_string_peaks_stand_beside_theory() -> None:
    sound = split()
    assert sound.summary["theory"] == pytest.approx([695.006, 374.234], abs=1e-3)
    assert sound.summary["peaks"] == pytest.approx(sound.summary["theory"], rel=1e-3)
    assert sound.microphones.shape == (2, 17640)
    assert split(contact=None).summary["theory"] == pytest.approx([243.25, 243.25], abs=0.01)
    assert split("drive.amplitude=0", "pluck.height=0").summary["peaks"] == [None, None]


def test_assignments_reach_every_part_of_the_split_string() -> None:
    tighter = split("string.tension=80", "contact.force=1.0", "drive.amplitude=0.002", "nodes=64")
    assert (tighter.summary["position"], tighter.summary["force"]) == (0.2275, 1.0)
    assert tighter.summary["theory"][0] == pytest.approx(695.006 * (86.0 / 65.0) ** 0.5, abs=1e-2)
    assert tighter.summary["peaks"] == pytest.approx(tighter.summary["theory"], rel=1e-3)
    assert abs(tighter.microphones).max() > abs(split().microphones).max()


def test_twin_peaks_stand_beside_theory_with_the_truth() -> None:
    sound = twin()
    summary = sound.summary
    assert sound.microphones.shape == (2, 22050)
    assert (summary["position"], summary["force"], summary["material"]) == (0.08, 1.0, "plastic")
    assert summary["settled"] == 1.0
    assert summary["contact"] == pytest.approx(1.0, abs=0.01)
    assert summary["felt"] == pytest.approx(1.0, rel=0.05)
    assert summary["slip"] < 0.05
    for peak, partial, base in zip(summary["peaks"], summary["partials"], summary["theory"], strict=True):
        # Stiffness, a compliant touch and the drivers' pull move a segment's line by some per cent.
        assert peak == pytest.approx(partial * base, rel=0.03)
    sliding = twin("across=0.02").summary
    assert sliding["slip"] > 0.9
    assert sliding["slip_velocity"] == pytest.approx(0.02, rel=0.25)


def test_an_untouched_twin_has_neither_touch_nor_force_and_a_silent_one_no_peak() -> None:
    summary = twin(contact=None).summary
    assert summary["theory"] == pytest.approx([1010.565, 1010.565], abs=0.01)
    assert [summary[name] for name in ("position", "force", "material", "slip", "felt")] == [None] * 5
    assert summary["contact"] == 0.0
    assert summary["peaks"][0] == pytest.approx(summary["peaks"][1], rel=1e-3)
    silent = twin("drivers=[false, false]", "pluck.height=0", contact=None)
    assert silent.summary["peaks"] == [None, None]


def test_assignments_and_options_reach_every_part_of_the_twin() -> None:
    tighter = twin("sensor.string.tension=80", "contact.force=0.5", "material=wood", "seed=3").summary
    assert (tighter["position"], tighter["force"], tighter["material"]) == (0.08, 0.5, "wood")
    plain = twin("contact.force=0.5", "material=wood", "seed=3").summary
    # By the square root, but for the press, which stretches a tighter string less.
    assert tighter["theory"][0] == pytest.approx(plain["theory"][0] * (80.0 / 65.0) ** 0.5, rel=1e-3)
    assert tighter["peaks"][0] / tighter["partials"][0] > 1.05 * plain["peaks"][0] / plain["partials"][0]
    linear = twin(contact=Contact(position=0.08, force=2.0), seconds=0.3, tension_law="linear").summary
    assert linear["tension_law"] == "linear"
    assert linear["peaks"] == twin("tension_law=linear", "contact.force=2.0", seconds=0.3).summary["peaks"]


def test_a_string_has_its_own_sensor_or_one_made_for_it() -> None:
    for name in sensor_names():
        string = load_sensor(name).string
        assert load_sensor(sensor_of(string).name).string == string
    for name in ("appendix", "bass_100", "wound_036"):
        string = load_string(name).string
        sensor = sensor_of(string)
        assert sensor.string == string
        for driver, model in zip(sensor.drivers, load_sensor("prototype").drivers, strict=True):
            assert driver.drive / string.length == pytest.approx(model.drive / PROTOTYPE.string.length)


@pytest.mark.parametrize(
    ("field", "wrong"),
    [
        ("drive.amplitud", lambda: split("drive.amplitud=1")),
        ("contact.positon", lambda: split("contact.positon=0.1")),
        ("litteral", lambda: split("drive.feedback=litteral")),
        ("nodes", lambda: split("nodes=many")),
        ("contact.positon", lambda: twin("contact.positon=0.1")),
        ("0.3", lambda: twin("contact.position=0.3")),
        ("geometrik", lambda: twin("tension_law=geometrik")),
        ("wod", lambda: twin("material=wod")),
        ("pickups.own", lambda: twin("sensor.pickups.own=[0.5, 0.5]")),
        ("world", lambda: twin("world=real")),
        ("0.001", lambda: twin(seconds=0.001)),
        ("split_strin", lambda: SIMULATORS.load("split_strin")),
        ("modl", lambda: SIMULATORS.build("split_string", {"route": "modl"})),
    ],
)
def test_a_wrong_assignment_option_or_name_is_refused(field: str, wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError, match=field):
        wrong()


def test_the_twin_sounds_otherwise_in_a_plausible_world() -> None:
    ideal, plausible, other = (
        twin(*assignments) for assignments in ((), ("world=plausible",), ("world=plausible", "seed=1"))
    )
    for one, another in ((ideal, plausible), (plausible, other)):
        assert abs(one.microphones - another.microphones).max() > 0.01
        assert one.summary["felt"] == pytest.approx(another.summary["felt"], rel=0.05)
