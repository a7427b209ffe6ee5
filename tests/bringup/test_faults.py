"""Faults of a newly built sensor, made in the virtual one: each is named, and none of a healthy build."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import monochord as mc
from monochord.bringup import STEPS, BringUp, Virtual, examine
from monochord.bringup.check import Take
from monochord.bringup.inputs import inputs_check
from monochord.lab.deviation import Deviation
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import End, Sensor, sensor_of

SECONDS = {
    "quiet": 3.0, "pluck": 1.0, "tap": 1.0, "press": 1.6, "damped": 1.5,
    "driver_1": 2.5, "driver_2": 2.5, "both": 2.5,
}  # fmt: skip
"""Shorter steps than a person's."""
Change = Callable[[Sensor], Sensor]


def as_is(sensor: Sensor) -> Sensor:
    return sensor


def gain(number: int, factor: float) -> Change:
    def change(sensor: Sensor) -> Sensor:
        first, second = sensor.pickups.gain
        changed = (factor * first, second) if number == 1 else (first, factor * second)
        return replace(sensor, pickups=replace(sensor.pickups, gain=changed))

    return change


def level(number: int, value: float) -> Change:
    def change(sensor: Sensor) -> Sensor:
        first, second = sensor.drivers
        weak = replace(sensor.drivers[number - 1], level=value)
        return replace(sensor, drivers=(weak, second) if number == 1 else (first, weak))

    return change


def hum(sensor: Sensor) -> Sensor:
    return replace(sensor, pickups=replace(sensor.pickups, hum=(0.02, 0.02)))


def feed(sensor: Sensor) -> Sensor:
    return replace(sensor, pickups=replace(sensor.pickups, feed=(30.0, 30.0)))


def crosstalk(sensor: Sensor) -> Sensor:
    return replace(sensor, pickups=replace(sensor.pickups, own=(0.52, 0.52)))


def loose(sensor: Sensor) -> Sensor:
    end = End(compliance=5e-6, admittance=0.04, frequency=1500.0, quality=0.3)
    losses = replace(sensor.losses, support=4.0 * sensor.losses.support)
    return replace(sensor, losses=losses, ends=(sensor.ends[0], end))


FAULTS: Mapping[str, tuple[Change, tuple[str, ...]]] = {
    "microphone 1 dead": (Deviation(dead_microphone=1).of_sensor, ("microphone 1 dead",)),
    "microphone 2 dead": (Deviation(dead_microphone=2).of_sensor, ("microphone 2 dead",)),
    **{f"microphone {n} low": (gain(n, 0.05), (f"microphone {n} low",)) for n in (1, 2)},
    **{f"microphone {n} clipped": (gain(n, 15.0), (f"microphone {n} clipped",)) for n in (1, 2)},
    "microphones swapped": (Deviation(swapped=True).of_sensor, ("microphones swapped",)),
    **{f"driver {n} dead": (Deviation(dead_driver=n).of_sensor, (f"driver {n} dead",)) for n in (1, 2)},
    "driver 1 weak": (level(1, 0.3), ("driver 1 weak",)),
    "driver 2 weak": (level(2, 0.25), ("driver 2 weak",)),
    "hum": (hum, ("hum",)),
    "pitch +6 %": (Deviation(pitch=0.06).of_sensor, ("wrong pitch",)),
    "pitch -7 %": (Deviation(pitch=-0.07).of_sensor, ("wrong pitch",)),
    "wrong rate": (as_is, ("wrong rate",)),
    "other string": (Deviation(gauge=1.2).of_sensor, ("other string",)),
    "loose end": (loose, ("loose end",)),
    "feed-through": (feed, ("feed-through into microphone 1", "feed-through into microphone 2")),
}  # fmt: skip
"""What is changed in a build, and the faults that are named for it."""


@cache
def result(build: int, name: str = "") -> BringUp:
    design = load_sensor("prototype")
    change = FAULTS[name][0] if name in FAULTS else {"crosstalk": crosstalk}.get(name, as_is)
    rate = 48000 if name == "wrong rate" else 44100
    sensor = change(sensor_of(design, "plausible", build=build))
    virtual = Virtual(sensor=sensor, seed=build, sample_rate=rate)
    takes = {step.name: virtual.take(replace(step, seconds=SECONDS[step.name])) for step in STEPS}
    return examine(
        "prototype", design, {step: replace(take, sample_rate=44100) for step, take in takes.items()}
    )


@pytest.mark.parametrize("name", ["microphones swapped", "driver 2 dead", "hum", "other string"])
def test_a_fault_is_named_and_no_other(name: str) -> None:
    assert result(1001, name).faults == FAULTS[name][1]
    assert not result(1001, name).passed


@pytest.mark.slow
@pytest.mark.parametrize("build", [1001, 1002])
@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_is_named_and_no_other(name: str, build: int) -> None:
    assert result(build, name).faults == FAULTS[name][1]


def test_a_healthy_build_has_no_fault_and_says_that_there_is_no_loopback() -> None:
    healthy = result(1001)
    assert healthy.faults == ()
    assert healthy.passed
    latency = next(check for check in healthy.checks if check.name == "latency by loop-back")
    assert latency.passed is None
    assert latency.advice.startswith("no loop-back")


@pytest.mark.slow
@pytest.mark.parametrize("build", range(1001, 1021))
def test_no_fault_is_named_on_healthy_builds(build: int) -> None:
    assert result(build).faults == ()


def test_a_driver_that_goes_over_to_a_louder_partial_is_not_weak() -> None:
    design = load_sensor("prototype")
    virtual = Virtual(sensor=sensor_of(design, "plausible", build=1001, day=5), seed=0, sample_rate=44100)
    takes = {step.name: virtual.take(step) for step in STEPS if step.name in ("quiet", "pluck", "driver_1")}
    found = examine("prototype", design, takes)
    slow = next(check for check in found.checks if check.name == "time of driver 1 to lock")
    assert slow.value is not None
    assert slow.value > 1.0, "it goes over from the second partial to the first"
    assert found.faults == ()


def test_two_microphones_on_one_block_are_not_told_apart() -> None:
    assert "crosstalk" in result(1004, "crosstalk").faults


def test_two_microphones_are_told_whatever_length_a_step_has() -> None:
    """A live step ends at any frame: what is left of its last tenth of a second tells nothing."""
    sensor = mc.VirtualSensor("prototype", seed=1)
    sound = sensor.advance(1.1)[0].astype(np.float32)
    for rest in (1, 64, 800, 4409):
        take = Take(samples=sound[:, : 39690 + rest], sample_rate=44100)
        assert inputs_check({"both": take}).passed
