"""The virtual sensor's speed: computing time by part, and for many sensors at once.

Makes what `docs/reference/twin.md` says of its speed, in some 30 seconds: ``python -m studies.twin_speed``.
"""

import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal, TypeAlias

import numpy as np
from studies._command import measure

from monochord import VirtualSensor
from monochord.benchmarks import one_core
from monochord.benchmarks.base import Benchmark, Row
from monochord.core.errors import InputError
from monochord.core.units import Seconds
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.split_string import SplitString, simulate
from monochord.physics.strings import load_string
from monochord.physics.twin import (
    Key,
    Outside,
    Pluck,
    Scene,
    Sensor,
    Touch,
    advance,
    advance_many,
    begin,
    hold,
    plausible_touch,
    sensor_of,
)

RATE = 44100
FDTD = "the paper's FDTD, compiled"
PLAUSIBLE_SEED = 3
"""Radius of the touching object, in m: with it, the plastic object has three modes below it."""
SETTLE: Seconds = 0.5
"""Warm-up sound before the timing, in s."""
LED_STEP: Seconds = 1e-3
World: TypeAlias = Literal["ideal", "plausible"]
LED: Mapping[World, tuple[float, float]] = {"ideal": (0.2, 0.4), "plausible": (0.25, 0.9)}
"""Worlds in which a twin is led by arrays, and the time in ms aimed at with one new force and with ten."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin(Benchmark):
    """Computing time relative to audio time, for one twin on one core, and for many twins on all cores.

    Rows: the string alone, plucked (free); with both drivers (ebows); pressed besides (touch); and
    everything: a touch that slides to and fro, rough, on a drifting string in a noisy room (full), which is
    timed once more with all effects of the world `plausible`, beside the ideal one; then a touch whose force
    is new every millisecond, in both worlds. What is compiled has run once before. Both sides of a ratio take
    turns over stretches of the same length, and the median of their processor time counts, for other programs
    take a share of any machine.

    Parameters
    ----------
    sensor
        Sensor preset.
    seconds
        Duration of the audio for each row, in s.
    stretch
        Duration of each timed stretch, in s.
    sensors
        Number of simultaneous twins in the last rows.
    """

    sensor: str = "prototype"
    seconds: Seconds = 6.0
    stretch: Seconds = 0.1
    sensors: int = 64

    def __post_init__(self) -> None:
        if not 0.001 <= self.stretch <= self.seconds <= 3600.0:
            raise InputError(f"stretches of {self.stretch:g} s in {self.seconds:g} s", "1 ms to 3600 s")
        if not 2 <= self.sensors <= 4096:
            raise InputError(f"{self.sensors} sensors", "2 to 4096")

    def run(self) -> Iterator[Row]:
        """Time every row beside the paper's scheme, then many twins."""
        sensor = load_sensor(self.sensor)
        paper = load_string("appendix")
        setup = SplitString(string=paper.string, contact=paper.usual_contact)

        def fdtd() -> None:
            simulate(setup, self.stretch, route="fdtd")

        with one_core():
            for name in ("free", "ebows", "touch", "full"):
                pace, base = self._pair(_Sounding(sensor, _scene(name, sensor), self.stretch), fdtd)
                yield _row(f"{name}, time/audio", pace, FDTD, base)
            usual, built = _scene("full", sensor), sensor_of(sensor, "plausible")
            touches = tuple(plausible_touch(touch, PLAUSIBLE_SEED) for touch in usual.touches)
            plausible = _Sounding(built, replace(usual, touches=touches), self.stretch)
            pace, base = self._pair(plausible, _Sounding(sensor, usual, self.stretch))
            yield _row("full in the world plausible, time/audio", pace, "full, ideal", base)
            yield _row("paper's FDTD, time/audio", self._pair(fdtd, fdtd)[0], "real time", 1.0)
            for world, keys in product(LED, (1, 10)):
                yield self._led(world, keys)
        yield from self._many(sensor)

    def _pair(self, own: Callable[[], None], baseline: Callable[[], None]) -> tuple[float, float]:
        """Return the processor time relative to audio time of both, with alternating stretches."""
        times: tuple[list[Seconds], list[Seconds]] = ([], [])
        for work in (own, baseline):  # what compiles or begins is not timed
            work()
        for _ in range(round(self.seconds / self.stretch)):
            for work, taken in zip((own, baseline), times, strict=True):
                start = time.thread_time()
                work()
                taken.append(time.thread_time() - start)
        first, second = (float(np.median(taken)) / self.stretch for taken in times)
        return first, second

    def _led(self, world: World, keys: int) -> Row:
        """Time a force that is new every millisecond, as a simulation of a robot gives it."""
        twin = VirtualSensor(self.sensor, world=world, build=131, seed=1, objects=("plastic",))
        twin.lead(LED_STEP, position=0.09, force=1.0)
        twin.advance(SETTLE)
        seconds, taken = LED_STEP * keys, list[float]()
        for step in range(1 + round(self.seconds / seconds)):
            forces = 1.0 + 0.2 * np.sin(0.3 * (step * keys + np.arange(keys)))
            start = time.thread_time()
            twin.lead(LED_STEP, position=np.full((1, keys), 0.09), force=forces[None])
            twin.advance(seconds)
            taken.append(time.thread_time() - start)
        name = f"led and advanced by {1e3 * seconds:g} ms, {world}"
        value, aim = 1e3 * float(np.median(taken[1:])), LED[world][keys > 1]
        return Row(name=name, value=value, unit="ms", baseline="aimed at", baseline_value=aim)

    def _many(self, sensor: Sensor) -> Iterator[Row]:
        """Utilisation of all cores: speed on all cores over speed on one core, per core."""
        low, high = sensor.range
        plastic, cores = load_material("plastic"), len(os.sched_getaffinity(0))
        twins = [
            begin(sensor, Scene(touches=(hold(float(x), 1.0, plastic),)), seed=i)
            for i, x in enumerate(np.linspace(low, high, self.sensors))
        ]
        advance_many(twins, 100)
        frames = round(self.stretch * RATE)
        alone: list[float] = []
        together: list[float] = []
        for _ in range(8):  # in turn, so that both meet the same machine
            alone.append(_fastest(lambda: advance_many(twins, frames, cores=1), 1))
            together.append(_fastest(lambda: advance_many(twins, frames, cores=cores), 1))
        audio = self.stretch * self.sensors
        one, all_cores = min(alone) / audio, min(together) / audio
        yield _row(f"{self.sensors} touched twins, wall/audio", all_cores, "on one core", one)
        yield _row(f"share of {cores} cores used", one / all_cores / cores, "all of them", 1.0)


class _Sounding:
    """A settled twin that renders another stretch at each call."""

    def __init__(self, sensor: Sensor, scene: Scene, stretch: Seconds) -> None:
        _, self._twin = advance(begin(sensor, scene), round(SETTLE * RATE))
        self._frames = round(stretch * RATE)

    def __call__(self) -> None:
        _, self._twin = advance(self._twin, self._frames)


def _scene(name: str, sensor: Sensor) -> Scene:
    """Return the scene of a benchmark row."""
    pluck = Pluck(position=0.3 * sensor.string.length, height=1e-4)
    low, high = sensor.range
    here, plastic = low + 0.3 * (high - low), load_material("plastic")
    if name in {"free", "ebows"}:
        return Scene(pluck=pluck, drivers=(name == "ebows", name == "ebows"))
    if name == "touch":
        return Scene(touches=(hold(here, 1.0, plastic),))
    across = [Key(time=0.4 * i, position=here + 2e-3 * (i % 2), force=1.0, across=0.03) for i in range(60)]
    noise = np.random.default_rng(0).normal(0.0, 1e-3, RATE).astype(np.float32)
    return Scene(
        touches=(Touch(material=plastic, motion=tuple(across), rolls=False),), outside=Outside(samples=noise)
    )


def _fastest(work: Callable[[], object], repeats: int) -> Seconds:
    times: list[float] = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def _row(name: str, value: float, baseline: str, baseline_value: float) -> Row:
    return Row(name=name, value=value, unit="1", baseline=baseline, baseline_value=baseline_value)


if __name__ == "__main__":
    measure(Twin)
