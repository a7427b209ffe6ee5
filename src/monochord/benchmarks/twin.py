"""The virtual sensor's speed: how long it takes to sound, part by part, and over many sensors at once."""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from monochord.benchmarks._process import one_core
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
)
from monochord.physics.twin import Twin as VirtualSensor
from monochord.physics.twin.reference import advance_slowly
from monochord.physics.twin.world import plausible_touch, sensor_of

RATE = 44100
FDTD = "the paper's FDTD, compiled"
SLOW = "un-jitted reference"
PLAUSIBLE_SEED = 3
"""Of the touching object: with it the plastic one has three modes under it."""
SETTLE: Seconds = 0.5
"""Of sound before the clock starts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin(Benchmark):
    """Time over audio time of the twin on one core, and of many twins on all cores.

    Rows: the string alone, plucked (free); with both drivers (ebows); pressed besides (touch); and
    everything: a touch that slides to and fro, rough, on a drifting string in a noisy room (full), which is
    timed once more with all effects of the world `plausible`, beside the ideal one. What is compiled has run
    once before. Wall time of the fastest of many short stretches counts, for other programs take a share of
    any machine.

    Parameters
    ----------
    sensor
        Preset of the sensor.
    seconds
        Audio for each row.
    stretch
        Audio for each of the stretches that are timed, in s.
    sensors
        How many twins sound at once in the last rows.
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
        """Time every row, the baselines, and then many twins."""
        sensor = load_sensor(self.sensor)
        with one_core():
            paper = load_string("appendix")
            setup = SplitString(string=paper.string, contact=paper.usual_contact)
            simulate(setup, 0.05, route="fdtd")
            fdtd = _fastest(lambda: simulate(setup, 0.5, route="fdtd"), 3) / 0.5
            slow = self._pace(sensor, _scene("full", sensor), advance_slowly, stretch=0.005, count=4)
            for name in ("free", "ebows", "touch", "full"):
                pace = self._pace(sensor, _scene(name, sensor), advance)
                yield _row(f"{name}, wall/audio", pace, FDTD, fdtd)
            yield _row("full, wall/audio again", pace, SLOW, slow)
            yield _row("full in the world plausible, wall/audio", *self._plausible(sensor))
            yield _row("paper's FDTD, wall/audio", fdtd, "real time", 1.0)
            yield _row("un-jitted reference, wall/audio", slow, "real time", 1.0)
        yield from self._many(sensor)

    def _pace(
        self,
        sensor: Sensor,
        scene: Scene,
        go: Callable[[VirtualSensor, int], tuple[object, VirtualSensor]],
        *,
        stretch: Seconds | None = None,
        count: int | None = None,
    ) -> float:
        """Wall time over audio time of the fastest stretch, after the sound has begun."""
        _, twin = advance(begin(sensor, scene), round(SETTLE * RATE))
        stretch = self.stretch if stretch is None else stretch
        count = round(self.seconds / stretch) if count is None else count
        best, frames = np.inf, round(stretch * RATE)
        for _ in range(count):
            start = time.perf_counter()
            _, twin = go(twin, frames)
            best = min(best, time.perf_counter() - start)
        return best / stretch

    def _plausible(self, sensor: Sensor) -> tuple[float, str, float]:
        """Return the pace of everything in a plausible world, and in the ideal one; stretches take turns."""
        usual, built = _scene("full", sensor), sensor_of(sensor, "plausible")
        touches = tuple(plausible_touch(touch, PLAUSIBLE_SEED) for touch in usual.touches)
        scenes = (built, replace(usual, touches=touches)), (sensor, usual)
        frames = round(self.stretch * RATE)
        twins = [advance(begin(*scene), round(SETTLE * RATE))[1] for scene in scenes]
        best = [np.inf, np.inf]
        for _ in range(round(self.seconds / self.stretch)):
            for i, twin in enumerate(twins):
                start = time.perf_counter()
                _, twins[i] = advance(twin, frames)
                best[i] = min(best[i], time.perf_counter() - start)
        return best[0] / self.stretch, "full, ideal", best[1] / self.stretch

    def _many(self, sensor: Sensor) -> Iterator[Row]:
        """How well all cores are used: pace on one core over pace on all, over the number of cores."""
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


def _scene(name: str, sensor: Sensor) -> Scene:
    """Return what happens in a row of the benchmark."""
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
