"""What the world `plausible` adds to a twin: its effects as the records that the kernel runs on."""

from math import cos, exp, pi, sin, sqrt, tanh

import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds
from monochord.physics.twin.ends import offset_of, residual_shares
from monochord.physics.twin.records import (
    DRIVE_1,
    MAX_MOUNT_MODES,
    ChainParameters,
    CoilEffects,
    LayerParameters,
    MountOscillator,
    MountParameters,
    Plausible,
    Q,
    Records,
    dtype_of,
    record_of,
)
from monochord.physics.twin.setup import DISTORTION_LEVEL, HUM_SHARES, Mount, MountMode, Sensor, Touch

HUM_PLACES = 1025
"""Entries of the table of a cycle of the mains."""


def is_plausible(sensor: Sensor, touches: tuple[Touch, ...]) -> bool:
    """Return whether any effect is on that an ideal twin is compiled without."""
    pickups = sensor.pickups
    return (
        any(touch.mount != Mount() or touch.law.layer > 0.0 for touch in touches)
        or any(driver.bias != 0.0 or driver.pull > 0.0 for driver in sensor.drivers)
        or any((*pickups.distortion, *pickups.hum, *pickups.feed, pickups.residual))
        or offset_of(sensor) > 0.0
    )


def plausible_of(
    sensor: Sensor, touches: tuple[Touch, ...], *, rate: Hertz, step: Seconds, bank: Floats, weights: Floats
) -> Plausible | None:
    """Return what the world `plausible` adds to a sensor and its touches; None if no effect is on.

    `bank` has its modes a row a line, as they start, and `weights` are those of each mode at each touch.
    """
    if not is_plausible(sensor, touches):
        return None
    layers, mounts, modes = _mounts(touches, step)
    return Plausible(
        layers=layers,
        mounts=mounts,
        mount_modes=modes,
        coils=_coils(sensor, bank),
        chain=_chain(sensor, rate),
        hum=_hum(),
        end_shares=residual_shares(sensor, bank, weights),
    )


def _coils(sensor: Sensor, bank: Floats) -> Records:
    """Return what is asymmetric and magnetic of the drivers, under a string at rest or as it was plucked."""
    coils = np.zeros(2, dtype_of(CoilEffects))
    for d, driver in enumerate(sensor.drivers):
        rest, place = tanh(driver.bias), float(bank[DRIVE_1 + d] @ bank[Q])
        coils[d] = driver.bias, rest, 1.0 / (1.0 - rest**2), driver.pull, place, place, 0.0
    return coils


def _chain(sensor: Sensor, rate: Hertz) -> Records:
    pickups = sensor.pickups
    return record_of(
        ChainParameters,
        second=2.0 * pickups.distortion[0] / DISTORTION_LEVEL,
        third=4.0 * pickups.distortion[1] / DISTORTION_LEVEL**2,
        feed_own=pickups.feed[0],
        feed_other=pickups.feed[1],
        hum_1=pickups.hum[0],
        hum_2=pickups.hum[1],
        hum_step=pickups.mains / rate,
        normal=cos(pickups.angle),
        across=sin(pickups.angle),
        offset=offset_of(sensor),
    )


def _hum() -> Floats:
    """Return a cycle of the mains with its harmonics, of unit rms, its first value once more at the end."""
    share = np.arange(HUM_PLACES) / (HUM_PLACES - 1)
    cycle = sum(a * np.sin(2.0 * pi * (n + 1) * share) for n, a in enumerate(HUM_SHARES))
    return np.asarray(cycle / np.sqrt(0.5 * np.sum(np.square(HUM_SHARES))), dtype=np.float64)


def _mounts(touches: tuple[Touch, ...], step: float) -> tuple[Records, Records, Records]:
    """Return the touches' rough layers, their mounts, and the modes of these, at rest."""
    layers = np.zeros(len(touches), dtype_of(LayerParameters))
    mounts = np.zeros(len(touches), dtype_of(MountParameters))
    modes = np.zeros((len(touches), MAX_MOUNT_MODES), dtype_of(MountOscillator))
    for t, touch in enumerate(touches):
        layers[t] = touch.law.layer, touch.law.layer_load
        for i, mode in enumerate(touch.mount.modes):
            modes[t, i] = _mount_mode(mode, step)
        real = modes[t, : len(touch.mount.modes)]
        static = float(np.sum(1.0 / (real["mass"] * real["square"])))
        spring = touch.mount.compliance
        mounts[t] = spring, static + spring, real["q_force"].sum()
    return layers, mounts, modes


def _mount_mode(mode: MountMode, step: float) -> Records:
    """Return a mode at rest: its closed solution over a step under a held force."""
    omega, mass = 2.0 * pi * mode.frequency, mode.mass
    sigma = 0.5 * omega / mode.quality
    ring = sqrt(omega**2 - sigma**2)
    sine, cosine = exp(-sigma * step) * sin(ring * step) / ring, exp(-sigma * step) * cos(ring * step)
    return record_of(
        MountOscillator,
        mass=mass,
        square=omega**2,
        q_q=cosine + sigma * sine,
        q_v=sine,
        v_q=-(omega**2) * sine,
        v_v=cosine - sigma * sine,
        q_force=(1.0 - cosine - sigma * sine) / (mass * omega**2),
        v_force=sine / mass,
        q=0.0,
        v=0.0,
        v_free=0.0,
    )
