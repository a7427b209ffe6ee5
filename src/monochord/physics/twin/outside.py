"""The level of an outside sound, given as a signal-to-noise ratio against the sensor's own signal."""

from functools import lru_cache

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Metres, Seconds
from monochord.physics.setup import Outside, Pluck, Scene, Sensor
from monochord.physics.twin.stream import advance, begin

SETTLING: Seconds = 1.0
"""Time that the untouched string has to settle before its level is measured."""
MEASURING: Seconds = 0.5
"""Time over which its level is measured."""
MIN_SUSTAIN = 0.5
"""Power of the second half of that time, relative to the first's, from which a sound counts as sustained."""
PLUCK_HEIGHT: Metres = 1e-4
"""Of the pluck, at a fifth of the string, that the measurement starts from."""


def outside_at(samples: Audio, snr_db: float, sensor: Sensor, *, sample_rate: int = 44100) -> Outside:
    """Return mono sound from outside at a signal-to-noise ratio in dB against the untouched, settled string.

    The ratio is that of mean powers over both microphones: the string's, `untouched_power`, over the sound's
    as it arrives through the air, level^2 <s^2> (a1^2 + a2^2) / 2 with the pickups' `air`. What enters
    through the frame, by the sensor's `shake`, adds to that: it excites the string. Raises `InputError` if
    the samples are silent or of another shape, the ratio is not finite, no microphone picks up air-borne
    sound, or the untouched string decays to silence.

    >>> from monochord.physics.sensors import load_sensor
    >>> hum = np.sin(2 * np.pi * 100.0 * np.arange(44100) / 44100).astype(np.float32)
    >>> quiet, loud = (outside_at(hum, snr, load_sensor("prototype")).level for snr in (40.0, 20.0))
    >>> round(loud / quiet, 3)
    10.0
    """
    samples = np.asarray(samples, dtype=np.float32)
    if samples.ndim != 1 or not samples.size or not np.isfinite(samples).all() or not samples.any():
        raise InputError(
            f"an outside sound of shape {samples.shape}", "finite mono samples with sound in them"
        )
    if not np.isfinite(snr_db):
        raise InputError(f"signal-to-noise ratio {snr_db:g} dB", "a finite number")
    received = float(np.mean(np.square(sensor.pickups.air))) * float(np.mean(samples.astype(np.float64) ** 2))
    if received == 0.0:
        raise InputError(f"sensor {sensor.name}: air {sensor.pickups.air}", "a share above 0 in a microphone")
    signal = untouched_power(sensor, sample_rate=sample_rate)
    return Outside(samples=samples, level=float((signal / received * 10.0 ** (-snr_db / 10.0)) ** 0.5))


@lru_cache(maxsize=32)
def untouched_power(sensor: Sensor, *, sample_rate: int = 44100) -> float:
    """Return the mean power of both microphones, in full scale squared, of the untouched, settled string.

    Both drivers are on, and the string was plucked at a fifth of its length; after a second the power is
    measured over half a second. Other histories end in other modes, of other levels.

    `InputError` refuses a sound that decays, so that there is no level to refer to.

    >>> from monochord.physics.sensors import load_sensor
    >>> 1e-4 < untouched_power(load_sensor("prototype")) < 1.0
    True
    """
    pluck = Pluck(position=0.2 * sensor.string.length, height=PLUCK_HEIGHT)
    twin = begin(sensor, Scene(pluck=pluck), sample_rate=sample_rate)
    _, twin = advance(twin, round(SETTLING * sample_rate))
    take, _ = advance(twin, round(MEASURING * sample_rate))
    squares = take.microphones.astype(np.float64) ** 2
    power, half = float(np.mean(squares)), squares.shape[1] // 2
    sustained = np.mean(squares[:, half:]) > MIN_SUSTAIN * np.mean(squares[:, :half])
    if not sustained or power < 4.0 * sensor.pickups.hiss**2 + 1e-12:
        raise InputError(
            f"sensor {sensor.name}: an untouched string that decays to silence", "drivers that sustain it"
        )
    return power
