"""What an untouched, driven string settles into after different histories: how many patterns there are."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from monochord.core.types import Audio, Floats
from monochord.core.units import Newtons, Seconds
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import open_frequency
from monochord.physics.twin import Key, Pluck, Scene, Sensor, Touch, advance, begin

RATE = 44100
PARTIALS = 8
"""How many partials of the open string tell one pattern from another."""
FLOOR = -30.0
"""Level in dB of the whole below which a partial counts as absent."""
ALIKE = 6.0
"""Two sounds are of one pattern if no partial differs by more, in dB."""
STILL = 3.0
"""A sound is steady if no partial changes by more from one half to the next, in dB."""
LISTEN: Seconds = 1.0
"""The end of each take, listened to in two halves."""
PLUCKED = 0.25
"""Share of histories that are plucks; the others are touches."""
OBJECTS = ("plastic", "wood", "metal_tube")
LIGHTEST: Newtons = 0.1
HARDEST: Newtons = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """What befalls the string before it is left alone at `released`."""

    scene: Scene
    released: Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """How histories ended: `levels` (n, 2, partials) in dB of the whole, `steady` (n,), `pattern` (n,).

    Patterns are numbered by how often they came, 0 first; a sound that is not steady has -1.
    """

    levels: Floats
    steady: np.ndarray
    pattern: np.ndarray

    def counts(self) -> list[int]:
        """Return how often each pattern came, the most frequent first."""
        return np.bincount(self.pattern[self.pattern >= 0]).tolist()

    def spoken_for(self, pattern: int) -> int:
        """Return the history whose sound is nearest to the mean of its pattern."""
        own = np.flatnonzero(self.pattern == pattern)
        off = np.abs(self.levels[own] - self.levels[own].mean(axis=0)).max(axis=(1, 2))
        return int(own[np.argmin(off)])


def history(sensor: Sensor, seed: int) -> History:
    """Return the history of a seed: a touch that presses, moves and lets go, or a pluck."""
    chance = np.random.default_rng([seed, 1])
    if chance.random() < PLUCKED:
        place, height = chance.uniform(0.1, 0.9), chance.uniform(2e-4, 2e-3)
        length = sensor.string.length
        return History(
            scene=Scene(pluck=Pluck(position=place * length, height=height * length)), released=0.0
        )
    here, there = (float(place) for place in chance.uniform(*sensor.range, 2))
    force = float(np.exp(chance.uniform(np.log(LIGHTEST), np.log(HARDEST))))
    harder = float(np.clip(force * chance.uniform(0.5, 1.5), LIGHTEST, HARDEST))
    down, rest, travel, up = (
        float(chance.uniform(low, high)) for low, high in ((0.02, 0.1), (0.1, 0.5), (0.05, 0.3), (0.01, 0.1))
    )
    travel += 2.0 * abs(there - here)  # 0.5 m/s at most
    times = np.cumsum([0.05, down, rest, travel, up]).tolist()
    keys = (
        Key(time=times[0], position=here, clearance=1e-3),
        Key(time=times[1], position=here, force=force),
        Key(time=times[2], position=here, force=force),
        Key(time=times[3], position=there, force=harder),
        Key(time=times[4], position=there, clearance=1e-3),
    )
    material = load_material(OBJECTS[int(chance.integers(len(OBJECTS)))])
    touch = Touch(material=material, motion=keys, rolls=bool(chance.integers(2)))
    return History(scene=Scene(touches=(touch,)), released=times[4])


def sound_of(sensor: Sensor, seed: int, after: Seconds, noise: int | None = None) -> tuple[Audio, Seconds]:
    """Return both microphones until `after` the release, (2, n), and when that was.

    `noise` seeds the converter's noise and the object's surface, as `seed` does by default.
    """
    past = history(sensor, seed)
    twin = begin(sensor, past.scene, sample_rate=RATE, seed=seed if noise is None else noise)
    take, _ = advance(twin, round((past.released + after) * RATE))
    return take.microphones, past.released


def partial_levels(microphones: Audio, sensor: Sensor) -> Floats:
    """Return the power around each partial of the open string, (2, partials), in dB of the whole."""
    count = microphones.shape[1]
    power = np.abs(np.fft.rfft(microphones * np.hanning(count), axis=1)) ** 2
    nearest = np.rint(np.fft.rfftfreq(count, 1.0 / RATE) / open_frequency(sensor.string)).astype(int)
    around = np.array([power[:, nearest == n].sum(axis=1) for n in range(1, PARTIALS + 1)]).T
    return np.maximum(10.0 * np.log10(around / around.sum() + 1e-30), FLOOR)


def patterns(levels: Floats) -> np.ndarray:
    """Return which pattern each sound is of, (n,): those alike, and those alike to one of them, are one."""
    count = levels.shape[0]
    flat = levels.reshape(count, -1)
    alike = np.abs(flat[:, None] - flat[None]).max(axis=2) <= ALIKE
    found = np.arange(count)
    while True:
        spread = np.where(alike, found, count).min(axis=1)
        if (spread == found).all():
            break
        found = spread
    _, index, sizes = np.unique(found, return_inverse=True, return_counts=True)
    place = np.empty_like(sizes)
    place[np.argsort(-sizes, kind="stable")] = np.arange(sizes.size)
    return place[index]


@lru_cache(maxsize=8)
def study(name: str, histories: int, first: int, after: Seconds) -> Study:
    """Let a sensor go through histories of the seeds from `first` on, and sort what they end in."""
    sensor, half = load_sensor(name), round(0.5 * LISTEN * RATE)
    levels, before = np.empty((2, histories, 2, PARTIALS))
    for i in range(histories):
        heard, _ = sound_of(sensor, first + i, after)
        levels[i] = partial_levels(heard[:, -half:], sensor)
        before[i] = partial_levels(heard[:, -2 * half : -half], sensor)
    steady = np.abs(levels - before).max(axis=(1, 2)) <= STILL
    pattern = np.full(histories, -1)
    if steady.any():
        pattern[steady] = patterns(levels[steady])
    return Study(levels=levels, steady=steady, pattern=pattern)
