"""Strings in MuJoCo: where they are, what leads their virtual sensors, and what a listener gets."""

from collections.abc import Mapping
from itertools import islice
from typing import Any

import numpy as np
import pytest

import monochord as mc
from monochord.sim._mujoco import mujoco
from monochord.sim.mujoco import Strings, add_string

GEOM, JOINT = mujoco.mjtGeom, mujoco.mjtJoint


def scene(*names: str, step: float = 1e-3, gravity: float = -9.81) -> Any:
    """Return a scene with strings in parallel, 0.1 m apart."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = step, [0.0, 0.0, gravity]
    for number, name in enumerate(names or ("left",)):
        y = 0.1 * number
        add_string(spec, body="world", start=(0, y, 0), end=(0.2, y, 0), press=(0, 0, -1), name=name)
    return spec


def ball(
    spec: Any,
    *,
    x: float = 0.08,
    y: float = 0.0,
    name: str = "ball",
    mass: float = 0.1,
    axis: Any = (0, 0, 1),
) -> Any:
    """Add a ball that lies on a string and moves along an axis alone."""
    body = spec.worldbody.add_body(name=name, pos=(x, y, 0.012))
    body.add_joint(type=JOINT.mjJNT_SLIDE, axis=axis, damping=1.0, name=f"{name}_joint")
    body.add_geom(type=GEOM.mjGEOM_SPHERE, size=(0.01, 0, 0), mass=mass, name=f"{name}_geom")
    return body


def simulated(spec: Any, **options: Any) -> tuple[Any, Any, Strings]:
    model = spec.compile()
    data = mujoco.MjData(model)
    return model, data, Strings(model, data, **options)


def test_a_string_has_a_frame_at_its_start() -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="finger", pos=(1, 2, 3))
    body.add_joint(type=JOINT.mjJNT_SLIDE)
    add_string(spec, body="finger", start=(0, 0, 0), end=(0, 0.2, 0), press=(0, 0.5, 1), name="left")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    site = data.site("left")
    assert site.xpos == pytest.approx([1, 2, 3])
    axes = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    assert np.allclose(site.xmat.reshape(3, 3).T, axes)
    backing = data.geom("left_backing").xpos - data.geom("left").xpos
    assert backing == pytest.approx([0, 0, 0.004])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"body": "hand"}, "body 'hand': expected one of world"),
        ({"end": (0.04, 0, 0)}, "a string of 40 mm: expected 50 mm or more"),
        ({"end": (0, 0, 0)}, "a string of 0 mm"),
        ({"press": (1, 0, 0)}, r"press \(1, 0, 0\) along the string: expected a direction across it"),
        ({"press": (0, 0, 0)}, r"press \(0, 0, 0\)"),
        ({"start": (0, 0)}, r"start \(0, 0\): expected three finite numbers"),
        ({"start": (0, 0, np.nan)}, r"start \(0, 0, nan\): expected three finite numbers"),
        ({"name": "left"}, "string 'left': expected a name that no geom or site has yet"),
    ],
)
def test_a_string_that_cannot_be_is_refused(changes: Mapping[str, Any], said: str) -> None:
    values: dict[str, Any] = {
        "body": "world",
        "start": (0, 0, 0),
        "end": (0.2, 0, 0),
        "press": (0, 0, -1),
        "name": "right",
    }
    with pytest.raises(mc.InputError, match=said):
        add_string(scene("left"), **{**values, **changes})


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"objects": {"cup": "plastic"}}, "object 'cup': expected a body or geom: ball, ball_geom"),
        ({"objects": {"ball": "plastik"}}, "material 'plastik'.*plastic"),
        ({"sensor": "long"}, "string 'left' of 200 mm with the sensor long: expected .* mm; move"),
        ({"sensors": {"rihgt": "prototype"}}, "a sensor for the string 'rihgt': expected one of left"),
        (
            {"objects": {"ball": "wood"}, "contacts": 5},
            "5 contacts for each of 2 materials: expected 8 in all",
        ),
        ({"contacts": 0}, "contacts"),
        ({"sample_rate": 44150}, "sample rate 44150 Hz: expected a multiple of 100 Hz"),
    ],
)
def test_strings_that_cannot_be_led_are_refused(options: Mapping[str, Any], said: str) -> None:
    spec = scene()
    ball(spec)
    with pytest.raises(mc.InputError, match=said):
        simulated(spec, **options)


@pytest.mark.parametrize("step", [3e-3, 0.02])
def test_a_time_step_that_does_not_divide_10_ms_is_refused(step: float) -> None:
    with pytest.raises(mc.InputError, match=r"time step .* expected one that divides 10 ms"):
        simulated(scene(step=step))


def test_a_scene_without_strings_and_an_unknown_string_are_refused() -> None:
    with pytest.raises(mc.InputError, match="a scene without strings: expected one or more; add_string"):
        simulated(mujoco.MjSpec())
    *_, strings = simulated(scene("left", "right"))
    assert list(strings) == ["left", "right"]
    with pytest.raises(mc.InputError, match="string 'wrist': expected one of left, right"):
        strings["wrist"]


def test_steps_that_are_not_read_are_refused_and_a_step_is_read_once() -> None:
    model, data, strings = simulated(scene())
    for _ in range(15):
        mujoco.mj_step(model, data)
        strings.read()
        strings.read()
    assert strings["left"].twin.sensor.time == pytest.approx(0.51)
    mujoco.mj_step(model, data, 2)
    with pytest.raises(
        mc.InputError, match="2 steps of MuJoCo since the last reading: expected one; call read"
    ):
        strings.read()
    strings.restart()
    strings.step()


@pytest.mark.parametrize("step", [1e-3, 2e-3, 5e-4])
def test_a_weight_presses_as_it_weighs_where_it_lies(step: float) -> None:
    spec = scene(step=step)
    ball(spec)
    _, _, strings = simulated(spec)
    string = strings["left"]
    for _ in range(round(0.5 / step)):
        strings.step()
    (contact,) = string.contacts
    assert contact.touches
    assert (contact.position, contact.force) == pytest.approx((0.08, 0.981), rel=1e-3)
    _, felt = string.twin.sensor.advance(0.01)
    assert felt["contact"].all()
    assert felt["position"] == pytest.approx(np.full(441, 0.08), abs=1e-6)
    assert felt["force"].mean() == pytest.approx(0.981, rel=0.02)
    assert string.counts.notes == ()


def test_updates_have_the_truth_of_mujoco_and_a_model_finds_it() -> None:
    spec = scene()
    ball(spec)
    _, data, strings = simulated(spec, seed=3)
    updates = list(mc.listen(strings["left"], seconds=1.0))
    last = updates[-1]
    assert [update.time for update in updates] == pytest.approx(0.01 * np.arange(91))
    assert data.time == pytest.approx(0.91)  # 0.1 s of sound was there, and a window more tells the end
    assert updates[0].truth["contact"] == 0.0
    assert (last.truth["contact"], last.truth["slip"]) == (1.0, 0.0)
    assert last.truth["position"] == pytest.approx(0.08, abs=1e-6)
    assert last.truth["force"] == pytest.approx(0.981, rel=1e-3)
    assert last.decided["contact"]
    assert last.position.value == pytest.approx(0.08, abs=5e-4)
    assert last.force.value == pytest.approx(0.981, abs=2.0 * last.force.std)
    assert last.force.std < 0.5


def test_the_sign_of_motion_is_the_strings() -> None:
    spec = scene()
    for x, axis in ((0.06, (1, 0, 0)), (0.14, (0, 1, 0))):
        body = spec.worldbody.add_body(pos=(x, 0, 0.012))
        for each in ((0, 0, 1), axis):
            body.add_joint(type=JOINT.mjJNT_SLIDE, axis=each)
        body.add_geom(type=GEOM.mjGEOM_SPHERE, size=(0.01, 0, 0), mass=1.0, friction=(0, 0, 0))
    _, data, strings = simulated(spec)
    data.qvel[[1, 3]] = 0.05
    for _ in range(20):
        strings.step()
    slow, fast = sorted(strings["left"].contacts, key=lambda each: each.position)
    assert (slow.along, slow.across) == pytest.approx((0.05, 0.0), abs=1e-3)
    assert (fast.along, fast.across) == pytest.approx((0.0, 0.05), abs=1e-2)
    assert slow.position == pytest.approx(0.061, abs=1e-4)


def test_whoever_steps_mujoco_finds_the_sound_and_the_listener_steps_nothing() -> None:
    spec = scene("left", "right")
    ball(spec)
    model, data, strings = simulated(spec)
    listeners = [mc.listen(strings[name], model="closed_form") for name in strings]
    firsts = [next(each) for each in listeners]
    assert data.time == 0.0
    for _ in range(10):
        mujoco.mj_step(model, data)
        strings.read()
    seconds = [next(each) for each in listeners]
    assert data.time == pytest.approx(0.01)
    thirds = [next(each) for each in listeners]  # both need a hop, which MuJoCo makes once
    assert data.time == pytest.approx(0.02)
    assert [update.time for update in thirds] == pytest.approx([0.02, 0.02])
    assert [update.time for update in firsts + seconds] == pytest.approx([0.0, 0.0, 0.01, 0.01])


def test_after_a_reset_the_string_sounds_as_at_first_and_the_stream_has_a_gap() -> None:
    spec = scene()
    ball(spec)
    model, data, strings = simulated(spec, seed=5, world="plausible")

    def heard() -> np.ndarray:
        sound: list[np.ndarray] = []
        for _ in range(30):
            for _ in range(10):
                strings.step()
            sound.append(strings["left"].sound)
        return np.concatenate(sound, axis=1)

    first = heard()
    updates = mc.listen(strings["left"], model="closed_form")
    first_window = next(updates).window
    assert not first_window.has_gap
    mujoco.mj_resetData(model, data)
    assert np.array_equal(heard(), first)
    after = [update.window.has_gap for update in islice(updates, 30)]
    assert after == [True] * 10 + [False] * 20
    assert strings["left"].sound.shape == (2, 441)


def test_a_blow_is_clipped_counted_and_noted_and_the_run_goes_on() -> None:
    spec = scene()
    ball(spec, mass=2.0)
    _, _, strings = simulated(spec)
    updates = list(mc.listen(strings["left"], model="closed_form", seconds=0.3))
    counts = strings["left"].counts
    assert counts.clipped > 50
    assert "of more than 10 N were clipped" in counts.notes[0]
    assert updates[-1].truth["force"] == pytest.approx(19.62, rel=0.01)


def test_contacts_beyond_the_slots_and_the_ends_are_counted() -> None:
    spec = scene()
    for number, x in enumerate((0.05, 0.1, 0.15, 0.199)):
        ball(spec, x=x, name=f"ball{number}", mass=0.1 + 0.1 * number)
    _, _, strings = simulated(spec)
    for _ in range(200):
        strings.step()
    _, felt = strings["left"].twin.sensor.advance(0.01)
    assert felt["contacts"].max() == 2
    assert felt["position"][-1] == pytest.approx(0.15, abs=1e-4)
    assert strings["left"].counts.extra > 100
    assert strings["left"].counts.off_string > 100


def test_each_object_is_of_its_material() -> None:
    spec = scene()
    hand = spec.worldbody.add_body(name="hand", pos=(0.05, 0, 0.012))
    hand.add_joint(type=JOINT.mjJNT_SLIDE, axis=(0, 0, 1))
    tip = hand.add_body(name="tip")
    tip.add_geom(type=GEOM.mjGEOM_SPHERE, size=(0.01, 0, 0), mass=0.1)
    ball(spec, x=0.15)
    _, _, strings = simulated(spec, objects={"hand": "rubber"}, contacts=1)
    for _ in range(100):
        strings.step()
    found = sorted(strings["left"].contacts)
    assert [(round(each.position, 3), each.material) for each in found] == [(0.05, 1), (0.15, 0)]


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_no_fast_finger_passes_a_string(speed: float) -> None:
    spec = scene()
    body = spec.worldbody.add_body(name="finger", pos=(0.1, 0, 0.03))
    body.add_joint(type=JOINT.mjJNT_SLIDE, axis=(0, 0, 1))
    body.add_geom(type=GEOM.mjGEOM_BOX, size=(0.015, 0.015, 0.005), mass=0.05)
    _, data, strings = simulated(spec)
    data.qvel[0] = -speed
    lowest = 1.0
    for _ in range(400):
        strings.step()
        lowest = min(lowest, float(data.body("finger").xpos[2]))
    assert lowest > 0.002  # its face stays above the middle of what is behind the string
    assert strings["left"].contacts


def test_at_rest_friction_creeps_below_what_counts_as_slip() -> None:
    spec = scene()
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
    body = spec.worldbody.add_body(name="block", pos=(0.08, 0, 0.0119))
    for axis in ((0, 0, 1), (1, 0, 0)):
        body.add_joint(type=JOINT.mjJNT_SLIDE, axis=axis)
    body.add_geom(type=GEOM.mjGEOM_SPHERE, size=(0.01, 0, 0), mass=0.1)
    _, data, strings = simulated(spec)
    data.qfrc_applied[1] = 0.3  # of 0.98 N, below friction
    speeds: list[float] = []
    for _ in range(1000):
        strings.step()
        speeds += [abs(each.along) for each in strings["left"].contacts]
    assert max(speeds[500:]) < 5e-4


def test_strings_are_a_mapping() -> None:
    _, _, strings = simulated(scene("left", "right"))
    assert "left" in strings
    assert "middle" not in strings
    assert strings.get("middle") is None
    with pytest.raises(KeyError, match=r"^string 'middle': expected one of"):
        strings["middle"]
    assert strings.get("right") is strings["right"]
