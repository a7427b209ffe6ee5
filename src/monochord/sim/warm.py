"""Untouched strings that sound steadily, kept in the process, so that an episode begins in a millisecond."""

import copy
import itertools
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np
from msgspec import Meta

from monochord.core.ranges import Checked, Seed
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.physics.sensors import with_sensor
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.physics.twin.world import World
from monochord.sim.observation import ObservationKind, Observer, observe, observer

__all__ = ["Hop", "StringSettings", "WarmString", "warm_string"]

UNTOUCHED: Seconds = 0.6
"""How long at least a string sounds before an episode: the model takes its pitch from it."""
Hop: TypeAlias = Annotated[Seconds, Meta(ge=0.01, le=0.1)]
"""Time from one observation to the next."""
MAX_KEPT = 256
"""Number of strings kept."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StringSettings(Checked):
    """A string and how it is observed.

    Parameters
    ----------
    sensor, seed, build, world
        As of `mc.VirtualSensor`.
    objects
        Materials of the objects that can touch it.
    observation, model, feature
        As of `monochord.sim.observation.observer`.
    hop
        Time from one observation to the next, 10 to 100 ms.
    """

    sensor: str | Path = "prototype"
    seed: Seed = 0
    build: Seed | None = None
    world: World = "ideal"
    objects: tuple[str | Path, ...] = ("plastic",)
    observation: ObservationKind = "estimates"
    model: str | Path = "demo"
    feature: str = "fft_harmonic"
    hop: Hop = 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WarmString:
    """A virtual sensor whose untouched string sounds, and an observer that has listened to it.

    Neither is changed: `begun` returns copies. `row` is the observation so far, and `frames` those of a hop.
    """

    sensor: VirtualSensor
    observer: Observer
    row: Audio
    frames: Samples

    def begun(self) -> tuple[VirtualSensor, Observer]:
        """Return a sensor and an observer that go on from here by themselves."""
        sensor = copy.copy(self.sensor)
        sensor.restore(self.sensor.snapshot())
        return sensor, self.observer.copy()


@lru_cache(maxsize=MAX_KEPT)
def warm_string(settings: StringSettings) -> WarmString:
    """Return the warm string of these settings; each is made once a process, in some 0.3 s.

    Examples
    --------
    >>> sensor, observer = warm_string(StringSettings(observation="sound")).begun()
    >>> round(sensor.time, 3), float(abs(observe([observer], [sensor.advance(0.02)[0]])).max()) > 0.01
    (0.6, True)
    """
    sensor = VirtualSensor(
        settings.sensor,
        seed=settings.seed,
        build=settings.build,
        world=settings.world,
        objects=settings.objects,
    )
    rate = sensor.sample_rate
    signal = with_sensor(Signal(sample_rate=rate, channels=2), sensor.design)
    listening = observer(settings.observation, signal, model=settings.model, feature=settings.feature)
    frames = round(settings.hop * rate)
    size = listening.size
    hops = -(-(round(UNTOUCHED * rate) - size) // frames)
    sound, _ = sensor.advance((size + hops * frames) / rate)
    edges = [0, *range(size, sound.shape[1] + 1, frames)]
    row = np.zeros(0, np.float32)
    for first, last in itertools.pairwise(edges):
        row = observe([listening], [sound[:, first:last]])[0]
    return WarmString(sensor=sensor, observer=listening, row=row, frames=frames)
