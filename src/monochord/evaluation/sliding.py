"""How well sliding can be told from rest in the twin's sound, by speed. All of it is simulated."""

from dataclasses import dataclass
from functools import cache
from math import exp, log

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import MetresPerSecond, Newtons, Seconds
from monochord.dsp.noise import pink
from monochord.evaluation.slip_features import filled_gaps, rumble
from monochord.metrics.ranking import Groups, area_interval, area_under_curve
from monochord.physics.materials import Material
from monochord.physics.theory import open_frequency
from monochord.physics.twin import Scene, Sensor, advance, begin, hold

RATE = 44100
FEATURES = ("rumble", "filled gaps")
PART = 0.5
"""Share of a window that has to slip for the window to count as slipping."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sliding:
    """Touches that slide across the string, and the same touches at rest.

    Positions are drawn evenly from the sensor's range, forces evenly in their logarithm, from streams that
    `seed` determines; each run has its own surface and noise. Every other run slides the other way. After
    `settle` the sound is cut into `windows` windows that do not overlap. A window counts if it is settled
    and in contact throughout, and slips for half of it or more, by the twin's label, or, at rest, never.

    With `noise`, pink noise of that level, in dB of full scale, is added to both microphones.
    """

    sensor: Sensor
    material: Material
    runs: int = 40
    seed: int = 0
    forces: tuple[Newtons, Newtons] = (0.2, 2.0)
    window: Seconds = 0.1
    windows: int = 5
    settle: Seconds = 0.6
    noise: float | None = None

    def __post_init__(self) -> None:
        if not (2 <= self.runs <= 10000 and 1 <= self.windows <= 1000):
            raise InputError(f"{self.runs} runs of {self.windows} windows", "2 to 10000 runs of 1 to 1000")
        if not 0.0 < self.forces[0] <= self.forces[1] <= 10.0:
            raise InputError(f"forces {self.forces[0]:g} to {self.forces[1]:g} N", "above 0 to 10 N, rising")
        if not (0.02 <= self.window <= 10.0 and 0.0 <= self.settle <= 10.0):
            given = f"windows of {self.window:g} s after {self.settle:g} s"
            raise InputError(given, "windows of 0.02 to 10 s after 10 s at most")
        if self.noise is not None and not -200.0 <= self.noise <= 0.0:
            raise InputError(f"noise of {self.noise:g} dB of full scale", "-200 to 0 dB")


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """How well one feature tells one speed from rest: area, its 95 % interval, and how many windows."""

    feature: str
    speed: MetresPerSecond
    area: float
    low: float
    high: float
    slipping: int
    resting: int


def told_apart(study: Sliding, speeds: tuple[MetresPerSecond, ...]) -> list[Told]:
    """Return how well each feature tells each speed from rest, feature by feature, speed by speed.

    Raises
    ------
    InputError
        If a speed is not above zero, or no window of a speed counts.
    """
    if not speeds or min(speeds) <= 0.0:
        raise InputError(f"speeds {', '.join(f'{v:g}' for v in speeds)} m/s", "one or more, above 0 m/s")
    told: list[Told] = []
    for number, feature in enumerate(FEATURES):
        resting = feature_values(study, 0.0)[number]
        for speed in speeds:
            slipping = feature_values(study, speed)[number]
            ones, others = np.concatenate(slipping), np.concatenate(resting)
            if ones.size == 0 or others.size == 0:
                given = f"{ones.size} windows that slip at {speed:g} m/s, {others.size} at rest"
                raise InputError(given, "windows of both", "settle longer, or take more runs")
            low, high = area_interval(slipping, resting, seed=study.seed)
            told.append(Told(
                feature=feature, speed=speed, area=area_under_curve(ones, others), low=low, high=high,
                slipping=ones.size, resting=others.size,
            ))  # fmt: skip
    return told


@cache
def feature_values(study: Sliding, speed: MetresPerSecond) -> tuple[Groups, ...]:
    """Return the values of every feature in dB at a speed, by run; see `FEATURES` for their order."""
    lowest = open_frequency(study.sensor.string)
    heard = [windows_of(study, run, speed) for run in range(study.runs)]
    return (
        [np.array([rumble(window, RATE, lowest) for window in run]) for run in heard],
        [np.array([filled_gaps(window, RATE) for window in run]) for run in heard],
    )


def windows_of(study: Sliding, run: int, speed: MetresPerSecond) -> list[Floats]:
    """Return the windows (2, n) of one run that count, at a speed in m/s or at rest."""
    stream = np.random.default_rng((study.seed, run))
    place = float(stream.uniform(*study.sensor.range))
    force = exp(stream.uniform(log(study.forces[0]), log(study.forces[1])))
    way = 1.0 if run % 2 == 0 else -1.0
    touch = hold(place, force, study.material, across=way * speed)
    seed = int(stream.integers(1 << 31))
    size, first = round(study.window * RATE), round(study.settle * RATE)
    take, _ = advance(begin(study.sensor, Scene(touches=(touch,)), seed=seed), first + study.windows * size)
    heard = take.microphones[:, first:].astype(np.float64)
    if study.noise is not None:
        heard += 10.0 ** (study.noise / 20.0) * pink(stream, heard.shape[1:], RATE)
    labels, kept = take.labels, list[Floats]()
    for start in range(first, first + study.windows * size, size):
        cut = slice(start, start + size)
        slips = float(labels.slip[0, cut].mean())
        right = slips >= PART if speed > 0.0 else slips == 0.0
        if right and labels.settled[cut].all() and labels.contact[0, cut].all():
            kept.append(heard[:, start - first : start - first + size])
    return kept
