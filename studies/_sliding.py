"""How well sliding is separated from rest in the twin's sound, by speed. Everything is simulated.

Two plain features of a window, each from the physics. A string and its two segments have no partial below the
open string's fundamental, and a touch at rest exerts no force on it slower than that. Sliding does: friction
builds up and yields, and the surface lifts and lowers the string. This slow force reaches both ends at once
and sounds as a *rumble*. And between the partials a string at rest is silent, while friction excites every
frequency: the *gaps fill*. Neither feature depends on position or force, and nothing in them is fitted to
data.
"""

from dataclasses import dataclass
from functools import cache
from math import exp, log

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, MetresPerSecond, Newtons, Seconds
from monochord.dsp import pink
from monochord.metrics import Groups, area_interval, area_under_curve
from monochord.physics.materials import Material
from monochord.physics.theory import open_frequency
from monochord.physics.twin import Scene, Sensor, advance, begin, hold

RATE = 44100
FEATURES = ("rumble", "filled gaps")
MIN_SLIP_SHARE = 0.5
"""Smallest share of slip in a window that counts as slipping."""
RUMBLE_START: Hertz = 30.0
"""Lower frequency limit of the rumble in Hz; a preamplifier passes little below it."""
GAP_BAND: tuple[Hertz, Hertz] = (4000.0, 15000.0)
"""Frequency band of the gaps in Hz: it holds many partials, all weak."""
MIN_POWER = 1e-20
"""Power added before taking a logarithm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sliding:
    """Touches that slide across the string, and the same touches at rest.

    Positions are uniform over the sensor's range, forces log-uniform over `forces`, both drawn from `seed`;
    each run has its own surface and noise. Every other run slides in the opposite direction. After `settle`
    the sound is cut into `windows` windows that do not overlap. A window counts if it is settled and in
    contact throughout and, by the twin's label, slips for half of it or more, or never where the touch rests.

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
class Separation:
    """Separation of one speed from rest by one feature: area under the curve and its 95 % interval."""

    feature: str
    speed: MetresPerSecond
    area: float
    low: float
    high: float
    slipping: int
    resting: int


def separations(study: Sliding, speeds: tuple[MetresPerSecond, ...]) -> list[Separation]:
    """Return how well each feature separates each speed from rest, by feature, then speed.

    Raises
    ------
    InputError
        If a speed is not above zero, or no window of a speed counts.
    """
    if not speeds or min(speeds) <= 0.0:
        raise InputError(f"speeds {', '.join(f'{v:g}' for v in speeds)} m/s", "one or more, above 0 m/s")
    rows: list[Separation] = []
    for number, feature in enumerate(FEATURES):
        resting = feature_values(study, 0.0)[number]
        for speed in speeds:
            slipping = feature_values(study, speed)[number]
            ones, others = np.concatenate(slipping), np.concatenate(resting)
            if ones.size == 0 or others.size == 0:
                given = f"{ones.size} windows slipping at {speed:g} m/s, {others.size} at rest"
                raise InputError(given, "windows of both", "settle longer, or take more runs")
            low, high = area_interval(slipping, resting, seed=study.seed)
            rows.append(Separation(
                feature=feature, speed=speed, area=area_under_curve(ones, others), low=low, high=high,
                slipping=ones.size, resting=others.size,
            ))  # fmt: skip
    return rows


@cache
def feature_values(study: Sliding, speed: MetresPerSecond) -> tuple[Groups, ...]:
    """Return the values of every feature in dB at a speed, by run; see `FEATURES` for their order."""
    lowest = open_frequency(study.sensor.string)
    windows = [windows_of(study, run, speed) for run in range(study.runs)]
    return (
        [np.array([rumble(window, RATE, lowest) for window in run]) for run in windows],
        [np.array([filled_gaps(window, RATE) for window in run]) for run in windows],
    )


def windows_of(study: Sliding, run: int, speed: MetresPerSecond) -> list[Floats]:
    """Return the windows (2, n) of one run that count, at a speed in m/s or at rest."""
    stream = np.random.default_rng((study.seed, run))
    place = float(stream.uniform(*study.sensor.range))
    force = exp(stream.uniform(log(study.forces[0]), log(study.forces[1])))
    direction = 1.0 if run % 2 == 0 else -1.0
    touch = hold(place, force, study.material, across=direction * speed)
    seed = int(stream.integers(1 << 31))
    size, first = round(study.window * RATE), round(study.settle * RATE)
    take, _ = advance(begin(study.sensor, Scene(touches=(touch,)), seed=seed), first + study.windows * size)
    sound = take.microphones[:, first:].astype(np.float64)
    if study.noise is not None:
        sound += 10.0 ** (study.noise / 20.0) * pink(stream, sound.shape[1:], RATE)
    labels, windows = take.labels, list[Floats]()
    for start in range(first, first + study.windows * size, size):
        cut = slice(start, start + size)
        slips = float(labels.slip[0, cut].mean())
        counts = slips >= MIN_SLIP_SHARE if speed > 0.0 else slips == 0.0
        if counts and labels.settled[cut].all() and labels.contact[0, cut].all():
            windows.append(sound[:, start - first : start - first + size])
    return windows


def rumble(samples: Audio | Floats, sample_rate: Hertz, open_frequency: Hertz) -> float:
    """Return the level below half the open string's fundamental, in dB of full scale.

    Parameters
    ----------
    samples
        A window, (channels, n), in full scale; the powers of the channels are added.
    sample_rate
        In Hz.
    open_frequency
        Of the untouched string, in Hz.

    Raises
    ------
    InputError
        If the window is too short to resolve anything below that frequency.

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 200.0 * np.arange(4410) / 44100.0)
    >>> round(rumble(np.array([tone, 0 * tone]), 44100.0, 1000.0), 1)
    -3.0
    """
    frequencies, power = _power(samples, sample_rate)
    low = (frequencies >= RUMBLE_START) & (frequencies < 0.5 * open_frequency)
    if low.sum() < 2:
        given = (
            f"a window of {samples.shape[1] / sample_rate:g} s and an open string of {open_frequency:g} Hz"
        )
        raise InputError(given, "a window of several periods of the open string")
    return float(10.0 * np.log10(power[low].sum() + MIN_POWER))


def filled_gaps(samples: Audio | Floats, sample_rate: Hertz) -> float:
    """Return the spectral flatness from 4 to 15 kHz in dB: geometric over arithmetic mean of the power.

    Parameters
    ----------
    samples
        A window, (channels, n), in full scale; the powers of the channels are added.
    sample_rate
        In Hz, more than twice 4 kHz.

    Returns
    -------
    float
        0 dB for a flat spectrum, -2.5 dB for one channel of white noise, far lower where lines stand out.

    References
    ----------
    Gray and Markel (1974), A spectral-flatness measure for studying the autocorrelation method of linear
    prediction of speech analysis, IEEE Trans. Acoust. Speech Signal Process. 22, 207.

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 6000.0 * np.arange(4410) / 44100.0)
    >>> filled_gaps(np.array([tone]), 44100.0) < -60.0
    True
    """
    frequencies, power = _power(samples, sample_rate)
    high = power[(frequencies >= GAP_BAND[0]) & (frequencies < GAP_BAND[1])] + MIN_POWER
    if high.size < 2:
        raise InputError(f"sample rate {sample_rate:g} Hz", f"above {2.0 * GAP_BAND[0]:g} Hz")
    return float(10.0 * (np.mean(np.log10(high)) - np.log10(np.mean(high))))


def _power(samples: Audio | Floats, sample_rate: Hertz) -> tuple[Floats, Floats]:
    """Return frequencies and the power of each under a Hann window; the powers sum to the mean square."""
    size = samples.shape[1]
    window = np.hanning(size)
    spectrum = np.fft.rfft(samples.astype(np.float64) * window, axis=1)
    power = 2.0 * np.sum(np.abs(spectrum) ** 2, axis=0) / (size * np.sum(window**2))
    return np.arange(power.size) * (sample_rate / size), power
