"""Carries out the steps of a bring-up on the virtual sensor: what a person's hands do, simulated."""

import numpy as np

from monochord.bringup.steps import PADS
from monochord.core.types import Audio
from monochord.core.units import Seconds
from monochord.physics.materials import load_material
from monochord.physics.twin import Pluck, Scene, Sensor, Touch, Twin, advance, begin, hold, switch
from monochord.physics.twin.trajectory import Stay, Tap, trajectory

TAP_SHARE, PRESS_SHARE, PLUCK_SHARE = 0.05, 0.35, 0.13
"""Where the string is tapped, pressed and plucked, as shares of its length from microphone 1."""
PLUCK_HEIGHT, START_HEIGHT = 1e-3, 2e-4
"""Height of the plucks, as shares of the length: to hear the string, and to give a driver something to
amplify."""
SWITCHED_ON: Seconds = 0.5
"""When a driver is switched on in its step."""
PRESS_FORCE, DAMPING_FORCE = 1.5, 1.0
"""Forces in N of the rod that presses, and of each of the pads that damp."""


def rehearse(
    sensor: Sensor, step: str, seconds: Seconds, *, seed: int = 0, sample_rate: int = 44100
) -> Audio:
    """Return the sound (2, n) of a step of the bring-up on a virtual sensor.

    In the step ``damped`` each driver's own coils are coupled: it oscillates at the centre of its band with
    its full force, and the pickups receive that by their `feed` (assumed; the twin's drivers are quiet
    without a string).
    """
    length = sensor.string.length
    count = round(seconds * sample_rate)

    def plucked(height: float, drivers: tuple[bool, bool], touches: tuple[Touch, ...] = ()) -> Twin:
        pluck = Pluck(position=PLUCK_SHARE * length, height=height * length)
        scene = Scene(pluck=pluck if height else None, drivers=drivers, touches=touches)
        return begin(sensor, scene, sample_rate=sample_rate, seed=seed)

    off = False, False
    match step:
        case "quiet":
            twin = plucked(0.0, off)
        case "tap":
            moves = Stay(seconds=0.5), Tap(force=0.5)
            motion = trajectory(moves, sensor.string, position=TAP_SHARE * length).keys
            twin = plucked(0.0, off, (Touch(material=load_material("wood"), motion=motion),))
        case "pluck":
            twin = plucked(PLUCK_HEIGHT, off)
        case "driver_1" | "driver_2" | "both" | "drift":
            on = step != "driver_2", step != "driver_1"
            before, twin = advance(plucked(START_HEIGHT, off), round(SWITCHED_ON * sample_rate))
            after, _ = advance(switch(twin, on), count - before.microphones.shape[1])
            return np.concatenate([before.microphones, after.microphones], axis=1)
        case "press":
            rod = hold(PRESS_SHARE * length, PRESS_FORCE, load_material("metal_tube"))
            twin = plucked(START_HEIGHT, (True, True), (rod,))
        case _:
            pad = load_material("foam")
            pads = tuple(hold(share * length, DAMPING_FORCE, pad) for share in PADS)
            take, _ = advance(plucked(START_HEIGHT, (True, True), pads), count)
            return take.microphones + _coupled(sensor, count, sample_rate)
    return advance(twin, count)[0].microphones


def _coupled(sensor: Sensor, count: int, sample_rate: int) -> Audio:
    """Return what the pickups receive of two drivers that oscillate without a string."""
    time = np.arange(count) / sample_rate
    near, far = sensor.pickups.feed
    sound = np.zeros((2, count))
    for d, driver in enumerate(sensor.drivers):
        drive = driver.level * driver.limit * np.sin(2.0 * np.pi * driver.centre * time)
        sound += np.outer((near, far) if d == 0 else (far, near), drive)
    return sound.astype(np.float32)
