"""The model of a force/torque sensor: friction, lever, crosstalk, bandwidth, noise and drift."""

from dataclasses import dataclass
from math import ceil

import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Hertz, MetresPerSecond
from monochord.lab.plan import ForceSensor
from monochord.physics.materials import Material

STANDSTILL: MetresPerSecond = 5e-4
"""Sliding speed at which friction is mostly developed.

A touch at rest is assumed to have no lateral force.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactHistory:
    """The contact at times (n,): normal force in N, and sliding speeds in m/s."""

    time: Floats
    normal: Floats
    along: Floats
    across: Floats


def wrench_of(contact: ContactHistory, material: Material, sensor: ForceSensor) -> Floats:
    """Return the wrench of a touch on its object, without noise: (n, 6), in N and N m.

    The string presses the object up with the normal force N, and drags it with the friction mu(v) N against
    its sliding speed v, with Stribeck's mu(v) = mu_k + (mu_s - mu_k) exp(-(v / v_s)^2). The sensor sits at
    `lever` above the touching point, which gives the torque r x f, r = (0, 0, -lever).

    >>> from monochord.physics.materials import load_material
    >>> rest, press = np.zeros(1), np.ones(1)
    >>> still = ContactHistory(time=rest, normal=press, along=rest, across=rest)
    >>> [round(x, 4) for x in wrench_of(still, load_material("plastic"), ForceSensor())[0].tolist()]
    [0.008, -0.005, 1.0, -0.0003, -0.0005, 0.0]
    """
    speed = np.hypot(contact.along, contact.across)
    static, kinetic = material.friction_static, material.friction_kinetic
    grip = kinetic + (static - kinetic) * np.exp(-((speed / material.stribeck_speed) ** 2))
    drag = -grip * contact.normal / np.hypot(speed, STANDSTILL)
    fx = drag * contact.along + sensor.crosstalk[0] * contact.normal
    fy = drag * contact.across + sensor.crosstalk[1] * contact.normal
    torque = sensor.lever * fy, -sensor.lever * fx, np.zeros_like(fx)
    return np.stack([fx, fy, contact.normal, *torque], axis=1)


def bandwidth_filter(bandwidth: Hertz, sample_rate: int) -> Floats:
    """Return the filter of sensor and object on a force: symmetrical taps (2 m + 1,) of sum 1.

    A well-damped mass on a spring: ``|H(f)| = 1 / sqrt(1 + (f / f0)^4)``. Far above the bandwidth f0 the gain
    is (f0 / f)^2, which leaves some of the string's vibration in the force. The filter has zero delay; the
    sensor's delay is part of its stream's. Nothing else prevents aliasing of high frequencies, as in a sensor
    that decimates without a filter.

    >>> taps = bandwidth_filter(500.0, 44100)
    >>> turn = np.exp(-2j * np.pi * np.arange(taps.size) / 44100)
    >>> [round(float(abs(taps @ turn**f)), 3) for f in (0, 500, 2000)]
    [1.0, 0.707, 0.062]
    """
    size = 1 << 15
    frequency = np.fft.rfftfreq(size, 1.0 / sample_rate)
    response = np.fft.irfft(1.0 / np.sqrt(1.0 + (frequency / bandwidth) ** 4), size)
    half = min(ceil(4.0 * sample_rate / bandwidth), size // 2 - 1)
    taps = np.concatenate([response[-half:], response[: half + 1]]) * np.hanning(2 * half + 3)[1:-1]
    return taps / taps.sum()


class SensorNoise:
    """Noise and drift of the sensor, reading by reading; reproducible from the random numbers."""

    def __init__(self, sensor: ForceSensor, random: np.random.Generator) -> None:
        self._random = random
        self._rms = np.repeat([sensor.noise, sensor.torque_noise], 3)
        drift = np.repeat([sensor.drift, sensor.drift * sensor.lever], 3)
        self._drift = drift * random.uniform(-1.0, 1.0, 6)

    def on(self, time: Floats) -> Floats:
        """Return the noise of readings at times (n,), which continue those of the last call: (n, 6)."""
        return self._random.normal(size=(len(time), 6)) * self._rms + np.outer(time, self._drift)
