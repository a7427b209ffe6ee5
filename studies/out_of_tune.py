"""Touches on strings that are out of tune: what is stated, and how much of it is wrong.

Prints its rows in some three minutes: ``python -m studies.out_of_tune``. All sound is simulated.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from studies._command import measure

import monochord as mc
from monochord.benchmarks.base import Benchmark, Row
from monochord.core.ranges import Checked
from monochord.core.types import Audio, Flags, Floats
from monochord.core.units import Metres, Seconds
from monochord.physics.sensors import load_sensor

SENSOR, HOP = "prototype", 0.02
TOUCHES = ((0.06, 1.0, "plastic"), (0.09, 0.6, "wood"), (0.13, 1.5, "metal_tube"))
"""Positions in m, forces in N and objects, one after another."""
BEFORE: Seconds = 1.0
HELD: Seconds = 1.5
RELEASED: Seconds = 0.6
FIRST: Seconds = 0.2
"""Untouched windows count from here on: the string is plucked at its beginning."""
WRONG: Metres = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class OutOfTune(Benchmark):
    """Shares of windows of the bundled model on plausible builds, by how far each string is out of tune.

    Each is untouched for a second, then touched three times. The model is told nothing of the tuning.

    Parameters
    ----------
    off
        Relative deviations of the open frequency.
    builds
        Builds of the prototype.
    """

    off: tuple[float, ...] = (-0.25, -0.2, -0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.25)
    builds: tuple[int, ...] = (131, 77, 300, 21, 402, 640)

    def __post_init__(self) -> None:
        Checked.__post_init__(self)

    def run(self) -> Iterator[Row]:
        """Measure every deviation."""
        for off in self.off:
            counts = np.sum([_counts(off, build) for build in self.builds], axis=0)
            held, answered, wrong, untouched, touched = counts.tolist()
            name = f"{100.0 * off:+.0f} %"
            yield Row(name=f"{name}: touched windows", value=held, unit="1")
            yield Row(name=f"{name}: position answered", value=100.0 * answered / held, unit="%")
            yield Row(name=f"{name}: more than 5 mm off", value=100.0 * wrong / held, unit="%")
            yield Row(name=f"{name}: untouched called touched", value=100.0 * touched / untouched, unit="%")


def _counts(off: float, build: int) -> tuple[int, ...]:
    """Return numbers of windows: held, answered, wrong, untouched, and such that are called touched."""
    sound, truth = _taken(off, build)
    table = mc.load("demo").predict(sound, hop=HOP, sensor=SENSOR)
    size = round(0.1 * 44100)
    places = np.stack([truth[start : start + size] for start in table.start])
    is_known = ~np.isnan(places)
    held, untouched = is_known.all(axis=1), ~is_known.any(axis=1) & (table.time > FIRST)
    answered = held & table.position.valid
    wrong = answered & (np.abs(table.position.value - places.mean(axis=1)) > WRONG)
    called: Flags = untouched & table.contact.valid & (table.contact.value > 0.5)
    return tuple(int(each.sum()) for each in (held, answered, wrong, untouched, called))


def _taken(off: float, build: int) -> tuple[Audio, Floats]:
    """Return the sound (2, n) of a string, and where it is touched (n,), NaN where it is not."""
    sensor = load_sensor(SENSOR)
    string = replace(sensor.string, tension=sensor.string.tension * (1.0 + off) ** 2)
    twin = mc.VirtualSensor(replace(sensor, string=string), seed=build, build=build, day=0, world="plausible")
    parts = [twin.advance(BEFORE)]
    for position, force, material in TOUCHES:
        twin.press(position, force, material=material)
        parts.append(twin.advance(HELD))
        twin.release()
        parts.append(twin.advance(RELEASED))
    sound = np.concatenate([each for each, _ in parts], axis=1)
    truth = [np.where(labels["contact"] > 0.0, labels["position"], np.nan) for _, labels in parts]
    return sound.astype(np.float32), np.concatenate(truth)


if __name__ == "__main__":
    measure(OutOfTune)
