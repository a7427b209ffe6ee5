"""What the world `plausible` adds to a twin: its effects as the records that the kernel runs on."""

from functools import lru_cache
from math import cos, exp, pi, sin, sqrt, tanh

import numpy as np

from monochord.core.types import Floats, StringParams
from monochord.core.units import Hertz, Metres, Seconds
from monochord.physics.setup import (
    DISTORTION_LEVEL,
    HUM_SHARES,
    MAX_MOUNT_MODES,
    Mount,
    MountMode,
    Sensor,
    Touch,
)
from monochord.physics.theory import turning_compliance
from monochord.physics.twin.ends import offset_of, residual_shares
from monochord.physics.twin.records import (
    DRIVE_1,
    TABLE_PLACES,
    ChainParameters,
    CoilEffects,
    LayerParameters,
    MountOscillator,
    MountParameters,
    Plausible,
    Q,
    Records,
    TurningState,
    dtype_of,
    record_of,
)
from monochord.physics.twin.surface import arm_of, edges_of

HUM_PLACES = 1025
"""Entries of the table of a cycle of the mains."""


def is_plausible(sensor: Sensor, touches: tuple[Touch, ...]) -> bool:
    """Return whether any effect is on that an ideal twin is compiled without."""
    pickups = sensor.pickups
    return (
        any(touch.mount != Mount() or touch.law.layer > 0.0 for touch in touches)
        or any(touch.law.width > 0.0 or touch.law.arm > 0.0 for touch in touches)
        or sensor.press_tension > 0.0
        or any(driver.bias != 0.0 or driver.pull > 0.0 for driver in sensor.drivers)
        or any((*pickups.distortion, *pickups.hum, *pickups.feed, pickups.residual))
        or offset_of(sensor) > 0.0
    )


def plausible_of(
    sensor: Sensor,
    touches: tuple[Touch, ...],
    *,
    rate: Hertz,
    step: Seconds,
    bank: Floats,
    weights: Floats,
    exact: Floats,
) -> Plausible | None:
    """Return what the world `plausible` adds to a sensor and its touches; None if no effect is on.

    `bank` has its modes a row a line, as they start, `weights` are those of each mode at each touch, and
    `exact` those of each mode at a point.
    """
    if not is_plausible(sensor, touches):
        return None
    layers, mounts, modes = _mounts(touches, step)
    turnings, slopes, tables = _turnings(sensor.string, touches, exact)
    half = weights.shape[1]
    return Plausible(
        layers=layers,
        mounts=mounts,
        mount_modes=modes,
        coils=_coils(sensor, bank),
        chain=_chain(sensor, rate),
        hum=_hum(),
        end_shares=residual_shares(sensor, bank, weights),
        turnings=turnings,
        slopes=np.zeros((len(touches), 2, half)),
        slope_weights=slopes,
        slope_compliance=tables,
        turned=np.zeros((2, len(touches), len(touches))),
    )


def _turnings(
    string: StringParams, touches: tuple[Touch, ...], exact: Floats
) -> tuple[Records, Floats, Floats]:
    """Return how the touches resist turning, each mode's weight in rad/m, and the turn along the string.

    The weight is that of a mode's slope between the edges or at a point, the turn that by a static moment, in
    rad/(N m).
    """
    turnings = np.zeros(len(touches), dtype_of(TurningState))
    slopes, tables = np.zeros((len(touches), exact.size)), np.zeros((len(touches), TABLE_PLACES))
    wave = np.arange(1, exact.size + 1) * pi / string.length
    for t, touch in enumerate(touches):
        edges, arm = edges_of(string, touch), arm_of(string, touch)
        turnings["half"][t], turnings["arm"][t] = 0.5 * edges, arm
        slopes[t] = exact * wave * np.sinc(0.5 * wave * edges / pi)
        if edges + arm > 0.0 and (edges > 0.0 or string.core_diameter > 0.0):
            tables[t] = _turning_table(string, edges)
        else:
            turnings["arm"][t] = 0.0  # a point of an ideally flexible string has no slope
    return turnings, slopes, tables


@lru_cache(maxsize=64)
def _turning_table(string: StringParams, width: Metres) -> Floats:
    """Return the static turn of a string by a moment along it, in rad/(N m)."""
    inside = 0.5 * width + 1e-6 * string.length
    place = np.clip(np.linspace(0.0, string.length, TABLE_PLACES), inside, string.length - inside)
    return turning_compliance(string, place, width)


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
        tension_per_force=sensor.press_tension,
        pressed=0.0,
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
