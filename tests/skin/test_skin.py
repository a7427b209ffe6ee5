"""A skin: contacts and wrenches in the frame of a link, all of their uncertainty, and what is withheld."""

import math
import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.cli.running import Capture, records, refusal

import monochord as mc
from monochord.cli import run
from monochord.cli._skin import with_skin
from monochord.core.config import dump_toml
from monochord.core.reasons import Reason
from monochord.core.types import StreamHealth, Tracked
from monochord.live.listen import live_run
from monochord.skin.update import SkinUpdate, contact_of
from monochord.skin.urdf import urdf, xacro

EPS = sys.float_info.epsilon
RADIUS, LENGTH = 0.03, 0.2


def ring(count: int = 8, radius: float = RADIUS, outward: float = 1.0, press_std: float = 0.0) -> mc.Skin:
    """Return strings along z on a cylinder, pressed towards its axis, or from inside."""
    strings: dict[str, mc.SkinString] = {}
    for k in range(count):
        away = np.array([math.cos(2 * math.pi * k / count), math.sin(2 * math.pi * k / count), 0.0])
        start, end = (tuple((radius * away + [0.0, 0.0, z]).tolist()) for z in (-0.5 * LENGTH, 0.5 * LENGTH))
        press: Any = tuple((-outward * away).tolist())
        strings[f"s{k + 1}"] = mc.SkinString(
            start=start, end=end, press=press, sensor="prototype", press_std=press_std
        )
    return mc.Skin(link="fingertip", strings=strings)


def estimate(value: float, std: float, unit: str = "") -> mc.Estimate:
    return mc.Estimate(value=value, std=std, unit=unit)


PLACE = estimate(0.08, 3e-4, "m")


def window(
    contact: float | mc.Estimate, position: mc.Estimate = PLACE, force: float | mc.Estimate = 1.2
) -> mc.Prediction:
    """Return the estimates of one window of a string."""
    estimates = {
        "contact": contact if isinstance(contact, mc.Estimate) else estimate(contact, 0.1),
        "position": position,
        "force": force if isinstance(force, mc.Estimate) else estimate(force, 0.2, "N"),
    }
    return mc.Prediction(start=0, time=0.25, estimates=estimates)


def update(decided: Mapping[str, bool], prediction: mc.Prediction) -> mc.Update:
    sound = mc.Window(samples=np.zeros((2, 4410), np.float32), start=0, sample_rate=44100)
    return mc.Update(
        prediction=prediction,
        window=sound,
        health=StreamHealth(),
        truth={},
        skipped=0,
        tracked=Tracked(estimates=prediction.estimates),
        decided=decided,
    )


def test_a_wrench_turns_and_moves_with_its_link() -> None:
    """By the adjoint: force and torque of a skin in another frame are those of the skin, seen from there."""
    turn, shift = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix(), np.array([0.1, -0.2, 0.3])
    worst = 0.0
    for string in ring().strings.values():
        start, end = (tuple((turn @ place + shift).tolist()) for place in (string.start, string.end))
        moved = replace(string, start=start, end=end, press=tuple((turn @ string.press).tolist()))
        here, there = (
            contact_of("s", each, estimate(0.08, 3e-4, "m"), estimate(1.2, 0.2, "N"))
            for each in (string, moved)
        )
        force = turn @ here.wrench[:3]
        adjoint = np.concatenate([force, turn @ here.wrench[3:] + np.cross(shift, force)])
        worst = max(
            worst, np.abs(adjoint - there.wrench).max(), np.abs(turn @ here.point + shift - there.point).max()
        )
    assert worst <= EPS  # of numbers up to 1.2


def test_the_covariance_is_that_of_many_errors() -> None:
    random, count = np.random.default_rng(0), 20_000
    string, start = ring(press_std=0.05).strings["s2"], np.array([0.021, 0.021, -0.07])
    string = replace(string, start=(0.021, 0.021, -0.07), end=(0.021, 0.021, 0.13))
    place, force = estimate(0.08, 1e-3, "m"), estimate(1.2, 0.2, "N")
    stated = contact_of("s2", string, place, force)
    errors = random.standard_normal((count, 3)) * [place.std, force.std, string.press_std]
    points, wrenches = np.empty((count, 3)), np.empty((count, 6))
    for row, (x, f, turned) in enumerate(errors):
        away = Rotation.from_rotvec([0.0, 0.0, turned]).as_matrix() @ string.direction
        points[row] = start + np.array([0.0, 0.0, 0.08 + x])
        wrenches[row] = np.concatenate([(1.2 + f) * away, np.cross(points[row], (1.2 + f) * away)])
    for drawn, said in ((points, stated.point_covariance), (wrenches, stated.wrench_covariance)):
        scale = np.sqrt(np.outer(np.diag(said), np.diag(said)))
        assert np.all(np.abs(np.cov(drawn.T) - said) <= 0.05 * scale + 1e-20)
        assert np.allclose(np.diag(np.cov(drawn.T)), np.diag(said), rtol=0.05, atol=1e-20)


def test_a_position_is_a_share_of_the_string() -> None:
    """The file's ends are 1 % further apart than the sensor's string is long: both ends stay ends."""
    string = replace(ring().strings["s1"], start=(0.03, 0.0, 0.0), end=(0.03, 0.0, 1.01 * LENGTH))
    assert string.at(LENGTH) == pytest.approx(np.array([0.03, 0.0, 1.01 * LENGTH]), abs=1e-15)
    contact = contact_of("s1", string, estimate(0.1, 1e-3, "m"), estimate(1.0, 0.1, "N"))
    assert contact.point[2] == pytest.approx(0.101, abs=1e-15)
    assert math.sqrt(contact.point_covariance[2, 2]) == pytest.approx(1.01e-3, rel=1e-12)


def test_a_press_acts_across_its_string() -> None:
    string = mc.SkinString(start=(0, 0, 0), end=(0.2, 0, 0), press=(0.5, 0, -1e-3 - 1), sensor="prototype")
    assert string.direction == pytest.approx(np.array([0.0, 0.0, -1.0]), abs=1e-15)


def both(first: mc.Prediction, second: mc.Prediction) -> SkinUpdate:
    return ring(2).combine({"s1": first, "s2": second})


def test_contacts_add_up() -> None:
    told = both(window(0.9, force=1.0), window(0.9, force=3.0))
    assert [each.string for each in told.contacts] == ["s1", "s2"]
    assert not told.withheld
    assert told.wrench[:3] == pytest.approx(np.array([2.0, 0.0, 0.0]), abs=1e-12)
    summed = sum(each.wrench for each in told.contacts), sum(each.wrench_covariance for each in told.contacts)
    assert np.array_equal(told.wrench, summed[0])
    assert np.array_equal(told.wrench_covariance, summed[1])
    assert told.time == 0.25
    untouched = both(window(0.1), window(0.1))
    assert untouched.contacts == ()
    assert not untouched.wrench.any()
    assert not untouched.withheld


OUTSIDE = mc.Estimate.abstain("m", Reason.OUTSIDE_RANGE)
UNCERTAIN = mc.Estimate.abstain("N", Reason.UNCERTAIN)
SILENT = mc.Estimate.abstain("", Reason.SILENCE)


WITHHELD: dict[str, tuple[mc.Prediction | None, Reason, bool]] = {
    "no position": (window(0.9, position=OUTSIDE), Reason.OUTSIDE_RANGE, True),
    "no force": (window(0.9, force=UNCERTAIN), Reason.UNCERTAIN, True),
    "neither": (window(0.9, position=OUTSIDE, force=UNCERTAIN), Reason.OUTSIDE_RANGE, True),
    "no contact": (window(SILENT), Reason.SILENCE, False),
    "nothing": (None, Reason.NOT_ESTIMATED, False),
}


@pytest.mark.parametrize("case", WITHHELD)
def test_what_is_withheld_is_told_with_its_reason(case: str) -> None:
    """The wrench of the link lacks a part then, so it is no number; the other string's contact stays."""
    told, reason, touched = WITHHELD[case]
    seen = ring(2).combine({"s1": window(0.9)} | ({} if told is None else {"s2": told}))
    assert dict(seen.withheld) == {"s2": reason}
    assert Reason.of(seen.withheld["s2"]) is reason
    assert [each.string for each in seen.contacts] == ["s1", "s2"][: 1 + touched]
    assert np.isfinite(seen.contacts[0].wrench).all()
    assert np.isnan(seen.wrench).all()
    assert np.isnan(seen.wrench_covariance).all()
    if touched:
        contact = seen.contacts[1]
        assert np.isnan(contact.wrench).any()
        assert np.isnan(contact.point).any() == (case != "no force")


def test_a_decision_counts_for_more_than_a_window() -> None:
    """Of updates: a touch is where contact is decided; before that the string is undecided, not untouched."""
    skin = ring(2)
    released = update({"contact": False}, window(0.9))
    held = skin.combine({"s1": update({"contact": True}, window(0.2)), "s2": released})
    assert [each.string for each in held.contacts] == ["s1"]
    assert not held.withheld
    early = skin.combine({"s1": update({}, window(0.2)), "s2": released})
    assert dict(early.withheld) == {"s1": Reason.UNDECIDED}
    silent = skin.combine({"s1": update({}, window(SILENT)), "s2": released})
    assert dict(silent.withheld) == {"s1": Reason.SILENCE}


def test_an_estimator_without_contact_tells_a_touch_by_its_place() -> None:
    place = mc.Prediction(start=0, time=0.0, estimates={"position": estimate(0.08, 3e-4, "m")})
    none = mc.Prediction(
        start=0, time=0.0, estimates={"position": mc.Estimate.abstain("m", Reason.NO_STRUCTURE)}
    )
    seen = ring(2).combine({"s1": place, "s2": none})
    assert [each.string for each in seen.contacts] == ["s1"]
    assert dict(seen.withheld) == {
        "s1": Reason.NOT_ESTIMATED,
        "s2": Reason.NO_STRUCTURE,
    }  # no force, no place


def test_a_string_of_another_skin_is_refused() -> None:
    with pytest.raises(mc.InputError, match=r"'S2': expected s1, s2; did you mean 's2'"):
        ring(2).combine({"S2": window(0.9)})


@pytest.mark.parametrize("count", [3, 8, 12, 16])
def test_neighbours_on_a_cylinder(count: int) -> None:
    half = math.pi / count
    pairs = ring(count).neighbours
    assert len(pairs) == count
    for each in pairs:
        assert each.distance == pytest.approx(2.0 * RADIUS * math.sin(half), rel=1e-9)
        assert each.sink == pytest.approx(
            RADIUS * (1.0 - math.cos(half)), rel=1e-9
        )  # of the arc over the chord
        assert each.angle == pytest.approx(2.0 * half, rel=1e-9)


def test_other_neighbours() -> None:
    (opposite,) = ring(2).neighbours  # on both faces of a bar: a plate on its side lies on its middle
    assert (opposite.distance, opposite.sink) == pytest.approx((2.0 * RADIUS, RADIUS))
    assert [each.sink for each in ring(8, outward=-1.0).neighbours] == [0.0] * 8  # inside a tube
    ends = (0.0, 0.0, 0.0), (0.2, 0.0, 0.0)
    flat = {
        f"s{k}": mc.SkinString(
            start=(0.0, 0.01 * k, 0.0), end=(0.2, 0.01 * k, 0.0), press=(0, 0, -1), sensor="prototype"
        )
        for k in range(3)
    }
    pairs = mc.Skin(link="palm", strings=flat).neighbours
    assert [(each.first, each.second, each.sink) for each in pairs] == [("s0", "s1", 0.0), ("s1", "s2", 0.0)]
    above = mc.SkinString(
        start=(0.25, 0.1, 0.03), end=(0.25, -0.1, 0.03), press=(0, 0, -1), sensor="prototype"
    )
    crossed = mc.Skin(link="palm", strings={"a": replace(flat["s0"], start=ends[0], end=ends[1]), "b": above})
    assert crossed.neighbours[0].distance == pytest.approx(math.hypot(0.05, 0.03), rel=1e-9)  # from its end


def sound_of(count: int, seconds: float = 0.8) -> tuple[np.ndarray[Any, Any], mc.VirtualSensors]:
    sensors = mc.VirtualSensors(count=count, seed=1)
    sensors[1].press(0.09, 1.0)
    return sensors.advance(seconds)[0], sensors


def test_a_skin_hears_each_string_as_it_is_heard_alone() -> None:
    sound, _ = sound_of(3)
    updates = list(ring(3).listen(sound.reshape(6, -1), sample_rate=44100))
    alone = [list(mc.listen(each, sample_rate=44100, sensor="prototype")) for each in sound]
    assert len(updates) == len(alone[0])
    for seen, *told in zip(updates, *alone, strict=True):
        assert [str(seen.strings[f"s{k + 1}"]) for k in range(3)] == [*map(str, told)]
    (contact,) = updates[-1].contacts
    assert contact.string == "s2"
    assert contact.point[2] == pytest.approx(-0.01, abs=5e-4)  # 90 mm from the end at -100 mm
    assert updates[-1].wrench == pytest.approx(contact.wrench)


def test_virtual_sensors_sound_as_their_array_does() -> None:
    sound, _ = sound_of(2)
    sensors = mc.VirtualSensors(count=2, seed=1)
    sensors[1].press(0.09, 1.0)
    skin = ring(2)
    live, array = skin.listen(sensors, seconds=0.8), skin.listen(sound.reshape(4, -1), sample_rate=44100)
    assert [repr(each) for each in live] == [repr(each) for each in array]


def test_a_source_opens_as_many_channels_as_the_strings_have() -> None:
    source: Any = live_run("jack", "closed_form", 1.0, 0.01, None, "", "", {}, ring(8).settings).source
    assert source.channels == 16
    with pytest.raises(mc.InputError, match="channel 4 of the string s2: expected 1 to 2"):
        next(ring(2).listen(np.zeros((2, 44100)), sample_rate=44100))


def file_of(folder: Path, skin: mc.Skin | None = None, **changes: Any) -> Path:
    """Write the file of a skin, its first string changed."""
    skin = skin or ring(2)
    tree: dict[str, Any] = {"link": skin.link, "strings": skin.tree()["strings"]}
    tree["strings"]["s1"] |= changes
    path = folder / "finger.toml"
    path.write_text(dump_toml(tree), encoding="utf-8")
    return path


def test_a_skin_is_read_from_its_file(tmp_path: Path) -> None:
    sensor = tmp_path / "left.toml"
    sensor.write_text("design = 'prototype'\n[tuning]\nopen_frequency = 1000.0\n", encoding="utf-8")
    skin = mc.load_skin(file_of(tmp_path, sensor="left.toml"))
    assert (skin.name, skin.link) == ("finger", "fingertip")
    tuned = skin.strings["s1"].loaded.string  # of the file beside the skin's, wherever the program runs
    assert mc.open_frequency(tuned) == pytest.approx(1000.0)
    assert skin.strings["s2"] == replace(ring(2).strings["s2"], channels=(3, 4))


ROBOT = '<robot name="arm"><link name="base"/><!-- kept --><link name="fingertip"/></robot>\n'
BAD: dict[str, tuple[dict[str, Any], str]] = {
    "start is end": ({"end": (0.03, 0.0, -0.1)}, "s1 from .*: expected two different ends"),
    "press along": (
        {"press": (0.1, 0, 1)},
        "press .*, 6 degrees from the string: expected a direction across",
    ),
    "no press": ({"press": (0, 0, 0)}, "press .0, 0, 0.: expected the direction"),
    "millimetres": ({"start": (30, 0, -100)}, "start.*30.*: expected a number from -5 to 5 m"),
    "another length": ({"end": (0.03, 0.0, 0.12)}, "s1: ends of 0.22 m: expected 0.2 m within 3 %"),
    "one channel twice": ({"channels": [3, 4]}, "channel 3 of the strings s1 and s2"),
    "a channel too many": ({"channels": [1, 2, 5]}, "channels 1, 2, 5 of the string s1: expected one or two"),
    "unknown sensor": ({"sensor": "prototpye"}, "did you mean 'prototype'"),
    "unknown key": ({"pres": [0, 0, 1]}, "did you mean 'press'"),
    "not a number": ({"press": [math.nan, 0, 1]}, "press"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    changes, line = BAD[case]
    with pytest.raises(mc.InputError, match=line) as refused:
        mc.load_skin(file_of(tmp_path, **changes))
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            ROBOT.replace('"fingertip"', '"finger_tip"'),
            "expected base, finger_tip; did you mean 'finger_tip'",
        ),
        (ROBOT.replace("</robot>", ""), "expected a URDF"),
        ("<sdf/>", "<sdf>"),
        (
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:finger/></robot>',
            "with xacro in it: expected a URDF; expand it",
        ),
        (None, "a readable URDF"),
    ],
)
def test_a_robot_must_have_the_link(text: str | None, line: str, tmp_path: Path) -> None:
    robot = tmp_path / "arm.urdf"
    if text is not None:
        robot.write_text(text, encoding="utf-8")
    with pytest.raises(mc.InputError, match=line):
        mc.load_skin(file_of(tmp_path), robot=robot)
    robot.write_text(ROBOT, encoding="utf-8")
    assert mc.load_skin(file_of(tmp_path), robot=robot).link == "fingertip"


def frames(text: str) -> dict[str, tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]]:
    """Return origin and axes of each fixed joint's child in its parent, as ROS reads them."""
    placed: dict[str, Any] = {}
    for joint in ET.fromstring(text).iter("joint"):  # noqa: S314
        assert joint.get("type") == "fixed"
        child, origin = joint.find("child"), joint.find("origin")
        assert child is not None
        assert origin is not None
        xyz, rpy = (np.fromstring(origin.get(name, ""), sep=" ") for name in ("xyz", "rpy"))
        turn = np.eye(3)
        for axis, angle in zip(np.eye(3), rpy, strict=True):  # about the fixed axes, x first
            turn = Rotation.from_rotvec(angle * axis).as_matrix() @ turn
        placed[child.get("link", "")] = xyz, turn
    return placed


def test_frames_of_a_urdf_are_the_strings(tmp_path: Path) -> None:
    """A place along x in a string's frame is its point on the link; z points away from the string."""
    random, strings = np.random.default_rng(3), dict(ring(8).strings)
    for k in range(8):
        span, press = random.normal(size=3), random.normal(size=3)
        end: Any = tuple((LENGTH * span / np.linalg.norm(span)).tolist())
        towards: Any = tuple(press.tolist())
        strings[f"r{k}"] = mc.SkinString(start=(0, 0, 0), end=end, press=towards, sensor="prototype")
    robot = tmp_path / "arm.urdf"
    robot.write_text(ROBOT, encoding="utf-8")
    text = urdf("arm", "fingertip", strings, robot)
    assert "<!-- kept -->" in text
    links = [each.get("name") for each in ET.fromstring(text).iter("link")]  # noqa: S314
    assert links == ["base", "fingertip", *(f"{name}_string" for name in strings)]
    placed = frames(text)
    for name, string in strings.items():
        origin, axes = placed[f"{name}_string"]
        assert origin + 0.08 * axes[:, 0] == pytest.approx(string.at(0.08), abs=2e-9)
        assert axes[:, 2] == pytest.approx(-string.direction, abs=2e-8)


def test_a_macro_has_the_frames_of_the_urdf() -> None:
    skin = ring(3)
    macro = xacro("my finger", "fingertip", skin.strings)
    assert '"my_finger_strings"' in macro
    plain = macro.replace("${prefix}", "").replace("${link}", "fingertip")
    one, other = frames(plain), frames(urdf("finger", "fingertip", skin.strings))
    assert one.keys() == other.keys()
    for name, (origin, axes) in one.items():
        assert np.array_equal(origin, other[name][0])
        assert np.array_equal(axes, other[name][1])


def test_the_command_prints_geometry_and_writes_frames(tmp_path: Path, capsys: Capture) -> None:
    file, out, robot = file_of(tmp_path, ring(8)), tmp_path / "arm_strings.urdf", tmp_path / "arm.urdf"
    robot.write_text(ROBOT, encoding="utf-8")
    assert run(["skin", str(file), "--robot", str(robot), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "s1 and s2: 23.0 mm apart" in printed
    assert "a plate sinks 2.3 mm" in printed
    assert frames(out.read_text(encoding="utf-8")).keys() == {f"s{k}_string" for k in range(1, 9)}
    (told,) = records(capsys, "skin", file)
    assert told["strings"]["s8"]["channels"] == [15, 16]
    assert len(told["neighbours"]) == 8
    assert "already exists" in refusal(capsys, "skin", file, "--out", out)
    again = refusal(capsys, "skin", file, "--robot", out, "--out", tmp_path / "twice.urdf")
    assert "with a link s1_string" in again
    macro = tmp_path / "finger.urdf.xacro"
    assert run(["skin", str(file), "--out", str(macro)]) == 0
    assert "finger_strings" in macro.read_text(encoding="utf-8")


def test_ros_has_the_strings_where_the_skin_says(tmp_path: Path) -> None:
    file = file_of(tmp_path)
    skin = mc.load_skin(file)
    ros = with_skin({"sinks": {"ros2": {"frame": "wire"}}}, file)["sinks"]["ros2"]
    assert ros["link"] == skin.link
    assert list(ros["poses"]) == [f"{name}_wire" for name in skin.strings]
    for string, pose in zip(skin.strings.values(), ros["poses"].values(), strict=True):
        turn = Rotation.from_euler("xyz", pose[3:])
        assert pose[:3] + turn.apply((0.08, 0.0, 0.0)) == pytest.approx(string.at(0.08))
        assert -turn.apply((0.0, 0.0, 1.0)) == pytest.approx(string.direction)
    mine = with_skin({"sinks": {"ros2": {"link": "tip", "poses": {}}, "udp": {}}}, file)["sinks"]
    assert mine == {"ros2": {"link": "tip", "poses": {}}, "udp": {}}


def test_live_runs_the_strings_of_a_skin(tmp_path: Path, capsys: Capture) -> None:
    import soundfile

    file, wav = file_of(tmp_path), tmp_path / "hand.wav"
    sound, _ = sound_of(2, 0.4)
    soundfile.write(wav, sound.reshape(4, -1).T, 44100, subtype="FLOAT")
    rows = records(capsys, "live", "demo", wav, "--skin", file)
    assert [row["string"] for row in rows[:4]] == ["s1", "s2", "s1", "s2"]
    assert "--skin with --sensor" in refusal(capsys, "live", "demo", wav, "--skin", file, "--sensor", "long")


def test_what_is_read_of_a_string_cannot_be_written_to() -> None:
    string = ring(1).strings["s1"]
    for vector in (string.direction, string.along):
        with pytest.raises(ValueError, match="read-only"):
            vector[0] = -1.0
    places = np.array([0.05, 0.1])
    assert np.array_equal(string.at(places), [string.at(place) for place in places])


def test_a_skin_listens_to_a_virtual_sensor_for_each_string() -> None:
    with pytest.raises(mc.InputError, match=r"3 virtual sensors.* 2, one for each of s1, s2"):
        next(ring(2).listen(mc.VirtualSensors(count=3)))


@pytest.mark.parametrize("ahead", [0, 1])
def test_sound_that_is_taken_of_one_string_is_a_gap_of_all(ahead: int) -> None:
    sensors = mc.VirtualSensors(count=2, seed=1)
    updates = ring(2).listen(sensors, seconds=0.6)
    for _ in range(20):
        next(updates)
    sensors[ahead].advance(0.05)
    heard = [(name, each) for update in updates for name, each in update.strings.items()]
    assert {name for name, each in heard if isinstance(each, mc.Update) and each.window.has_gap} == {
        "s1",
        "s2",
    }
