"""A virtual sensor that is led by arrays sounds as its touches' keys say, alone and among others."""

import copy
from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from monochord import InputError, VirtualSensor, VirtualSensors
from monochord.core.types import Audio, Floats
from monochord.physics.materials import load_material
from monochord.physics.setup import Key, Pluck, Scene, Touch
from monochord.physics.twin import advance, begin
from monochord.physics.twin.virtual_sensor import CLEARANCE, PLUCK
from monochord.physics.twin.world import World

STEP = 1.0 / 64.0
RATE = 64 * 704
"""A step that adds up without rounding, and a rate at which it ends with a control update of the twin."""
PLACE = np.linspace(0.08, 0.09, 16)
FORCE = np.concatenate((np.zeros(4), np.linspace(0.1, 1.2, 8), np.full(4, 1.2)))
GAP = np.concatenate((np.linspace(2e-3, 0.0, 4), np.zeros(12)))
ACROSS = np.concatenate((np.zeros(10), np.full(6, 0.03)))


def led(sensor: VirtualSensor, parts: int) -> tuple[Audio, Floats]:
    """Return sound and force of a sensor that is led in so many calls, each before its stretch of time."""
    sound, force = list[Audio](), list[Floats]()
    for place, press, gap, across in zip(
        *(np.split(rows, parts) for rows in (PLACE, FORCE, GAP, ACROSS)), strict=True
    ):
        sensor.lead(STEP, position=place, force=press, clearance=gap, across=across)
        audio, labels = sensor.advance(STEP * len(place))
        sound.append(audio)
        force.append(labels["force"])
    return np.concatenate(sound, axis=1), np.concatenate(force)


def test_it_sounds_as_a_scene_with_the_same_keys() -> None:
    sensor = VirtualSensor("prototype", seed=4, sample_rate=RATE, objects=["plastic"])
    sound, _ = led(sensor, 16)
    length = sensor.sensor.string.length
    times = STEP * np.arange(17)
    # In the air an object may be anywhere: it begins above its first place.
    columns = [np.append(first, rows) for first, rows in zip(
        (PLACE[0], 0.0, CLEARANCE, 0.0), (PLACE, FORCE, GAP, ACROSS), strict=True
    )]  # fmt: skip
    keys = [
        Key(time=time, position=place, force=force, clearance=gap, across=across)
        for time, place, force, gap, across in np.stack((times, *columns), axis=1).tolist()
    ]
    pluck = Pluck(position=0.2 * length, height=PLUCK * length)
    scene = Scene(
        pluck=pluck, touches=(Touch(material=load_material("plastic"), motion=tuple(keys), rolls=False),)
    )
    take, _ = advance(begin(sensor.sensor, scene, sample_rate=RATE, seed=4), RATE // 4)
    assert_array_equal(sound, take.microphones)


@pytest.mark.parametrize("world", ["ideal", "plausible"])
def test_many_short_steps_sound_as_one_long_one(world: World) -> None:
    takes = [
        led(VirtualSensor("prototype", seed=4, world=world, sample_rate=RATE, objects=["wood"]), parts)
        for parts in (1, 4, 16)
    ]
    for sound, force in takes[1:]:
        assert_array_equal(sound, takes[0][0])
        assert_array_equal(force, takes[0][1])
    assert np.nanmax(takes[0][1]) == pytest.approx(1.2, abs=0.05)


def test_a_snapshot_goes_on_as_before_on_any_sensor_of_the_design() -> None:
    sensor = VirtualSensor("prototype", seed=1, objects=["plastic"])
    sensor.lead(0.05, position=0.08, force=[0.0, 1.0], clearance=0.0)
    sensor.advance(0.15)
    then = sensor.snapshot()
    sensor.lead(0.05, position=0.09, force=[0.5, 0.2])
    sound, labels = sensor.advance(0.1)
    other = VirtualSensor("prototype", seed=1, objects=["plastic"])
    for each in (sensor, other):
        each.restore(then)
        assert each.time == pytest.approx(0.15)
        each.lead(0.05, position=0.09, force=[0.5, 0.2])
        again, told = each.advance(0.1)
        assert_array_equal(again, sound)
        assert_array_equal(told["force"], labels["force"])


def test_sensors_together_sound_as_each_alone() -> None:
    places = np.array([0.07, 0.08, 0.09, 0.11, 0.13])
    together = VirtualSensors(count=5, seed=3, build=20, world="plausible", objects=["wood"])
    together.lead(0.02, position=places[:, None, None], force=np.linspace(0.0, 1.0, 5))
    sound, labels = together.advance(0.12)
    assert sound.shape[:2] == (5, 2)
    for number, place in enumerate(places.tolist()):
        alone = VirtualSensor(seed=3 + number, build=20 + number, world="plausible", objects=["wood"])
        alone.lead(0.02, position=place, force=np.linspace(0.0, 1.0, 5))
        its_sound, its_labels = alone.advance(0.12)
        assert_array_equal(sound[number], its_sound)
        for name, column in its_labels.items():
            assert_array_equal(labels[name][number], column)
    states = together.snapshot()
    after, _ = together.advance(0.02)
    together.restore(states)
    assert_array_equal(together.advance(0.02)[0], after)


@pytest.mark.parametrize(
    ("ask", "given"),
    [
        (lambda sensor: sensor.lead(1e-3, position=0.3), "position 0.3"),
        (lambda sensor: sensor.lead(1e-3, position=0.08, force=11.0), "force 11"),
        (lambda sensor: sensor.lead(1e-3, position=0.08, clearance=-1e-3), "clearance -0.001"),
        (lambda sensor: sensor.lead(1e-3, position=0.08, across=float("nan")), "across nan"),
        (lambda sensor: sensor.lead(0.0, position=0.08), "step"),
        (lambda sensor: sensor.lead(1e-3, position=np.full((3, 4), 0.08)), r"arrays \(3, 4\)"),
        (lambda sensor: sensor.lead(1e-3, position=[0.08, 0.12]), "at 40 m/s along the string"),
        (lambda _: VirtualSensor("prototype").lead(1e-3, position=0.08), "lead without objects"),
        (lambda sensor: VirtualSensors(count=2).restore([sensor.snapshot()]), "1 snapshots"),
        (lambda sensor: sensor.restore(VirtualSensor(build=2).snapshot()), "a snapshot of another sensor"),
        (
            lambda _: VirtualSensors(count=2, objects=["wood"]).lead(1e-3, position=np.full((3, 1, 1), 0.08)),
            r"position of the shape \(3, 1, 1\)",
        ),
    ],
)
def test_what_cannot_be_led_is_one_line(ask: Callable[[VirtualSensor], object], given: str) -> None:
    sensor = VirtualSensor("prototype", objects=["plastic"])
    sensor.lead(1e-3, position=0.08)
    sensor.advance(2e-3)
    with pytest.raises(InputError, match=given) as caught:
        ask(sensor)
    assert "\n" not in str(caught.value)


def test_objects_that_are_led_stay_when_others_come_and_go() -> None:
    sensor = VirtualSensor("prototype", seed=2, objects=["plastic"])
    sensor.lead(0.05, position=0.08, force=[0.0, 0.6], clearance=0.0)
    sensor.advance(0.2)
    number = sensor.press(0.12, 0.5, material="wood")
    assert sensor.advance(0.2)[1]["contacts"][-1] == 2
    sensor.release(number)
    sensor.advance(0.3)
    sensor.press(0.11, 0.5, material="wood")
    assert sensor.advance(0.2)[1]["contacts"][-1] == 2
    sensor.release()
    assert sensor.advance(0.3)[1]["contacts"][-1] == 0


def test_a_slide_leaves_the_press_going_on_and_a_change_the_slide() -> None:
    sensor = VirtualSensor(seed=1)
    sensor.press(0.09, 1.0)
    sensor.slide(0.5, along=0.02)
    _, labels = sensor.advance(0.3)
    assert labels["force"][-1] == pytest.approx(1.0, rel=0.05)
    assert labels["position"][-1] == pytest.approx(0.09 + 0.02 * 0.29, abs=5e-4)
    sensor.change(2.0)
    sensor.slide(0.5, across=0.02)
    sensor.change(2.0)
    _, labels = sensor.advance(0.3)
    assert labels["force"][-1] == pytest.approx(2.0, rel=0.05)
    assert labels["slip_velocity"][-4410:].mean() == pytest.approx(0.02, rel=0.05)
    sensor.slide(0.5, across=0.02)
    sensor.release()
    assert not sensor.advance(0.2)[1]["contact"][-1]


def test_the_ninth_object_takes_the_place_of_one_that_is_up() -> None:
    sensor = VirtualSensor(seed=1)
    numbers = [sensor.press(0.06, 0.5)]
    for _ in range(8):
        numbers.append(sensor.press(0.12, 0.8))
        assert sensor.advance(0.15)[1]["contacts"][-1] == 2
        sensor.release(numbers[-1])
        sensor.advance(0.15)
    assert numbers == [0, 1, 2, 3, 4, 5, 6, 7, 1]
    sensor.press(0.1, 0.8)
    sensor.advance(0.15)
    sensor.change(1.4)  # the last one's
    _, labels = sensor.advance(0.1)
    assert labels["position"][-1] == pytest.approx(0.1, abs=1e-4)
    assert labels["force"][-1] == pytest.approx(1.4, rel=0.05)
    for place in np.linspace(0.04, 0.16, 6):
        sensor.press(place, 0.1)
    with pytest.raises(InputError, match="8 at once; release one"):
        sensor.press(0.1, 0.1)


def test_shares_of_a_frame_add_up() -> None:
    sensor = VirtualSensor(seed=1)
    for step in (1e-3, 1.0 / 240.0, 1e-5):
        before = sensor.time
        for _ in range(240):
            sensor.advance(step)
        assert sensor.time - before == pytest.approx(240 * step, abs=1.0 / 44100)


def test_a_copy_is_a_sensor_of_its_own_at_the_same_instant() -> None:
    sensor = VirtualSensor(seed=1, objects=["wood"])
    sensor.press(0.09, 1.0)
    sensor.advance(0.1)
    other = copy.copy(sensor)
    other.press(0.12, 1.0)
    assert sensor.advance(0.2)[1]["contacts"][-1] == 1
    assert other.advance(0.2)[1]["contacts"][-1] == 2
    plain = VirtualSensor(seed=1)
    plain.restore(other.snapshot())
    plain.lead(STEP, position=0.06, force=1.0)  # by the snapshot's object
    assert plain.advance(0.1)[1]["contacts"][-1] == 3
    twin = copy.copy(plain)
    assert_array_equal(twin.advance(0.1)[0], plain.advance(0.1)[0])


def test_what_no_object_may_do_is_refused_when_it_is_asked() -> None:
    sensor = VirtualSensor(seed=1)
    sensor.press(0.09, 1.0)
    sensor.advance(0.2)
    for refused in (
        lambda: sensor.change(50.0),
        lambda: sensor.slide(0.3, across=30.0),
        lambda: sensor.slide(0.05, along=-6.0),
    ):
        with pytest.raises(InputError):
            refused()
    assert sensor.advance(0.1)[1]["force"][-1] == pytest.approx(1.0, rel=0.05)


def test_sensors_are_led_all_or_none() -> None:
    sensors = VirtualSensors(count=2, objects=["plastic"])
    with pytest.raises(InputError, match="force 11"):
        sensors.lead(STEP, position=0.08, force=np.array([[[1.0]], [[11.0]]]))
    assert not sensors.advance(0.2)[1]["contact"].any()


def test_a_wide_object_off_the_string_is_refused_when_it_is_pressed() -> None:
    sensor = VirtualSensor(world="plausible", build=3, seed=3)  # its metal tube is 2.6 mm wide
    with pytest.raises(InputError, match="a touch at"):
        sensor.press(0.005, 1.0, material="metal_tube")
    sensor.press(0.006, 1.0, material="metal_tube")
    assert sensor.advance(0.2)[1]["contact"][-1] == 1.0
    with pytest.raises(InputError, match="a touch at"):
        sensor.slide(1.0, along=-0.001)
    assert sensor.advance(0.1)[1]["contact"][-1] == 1.0
