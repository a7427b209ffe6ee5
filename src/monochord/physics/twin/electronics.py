"""The electronics: EBows that drive the string, and the chain from its end forces to the converter.

An EBow pushes with F = F_max tanh(g y / F_max), y the velocity at its sense coil after a two-pole band filter
(after Heet 1978: feedback from a sense coil to a drive coil). The filter is the trapezoidal state-variable
one (Zavalishin 2012), and the force held over a step is that of its middle, extrapolated.

A driver may saturate unevenly (even harmonics), and its magnet pull the string by a negative stiffness. The
magnet's force, too, is that of the middle of a step, extrapolated: over any motion it does no more work than
the potential gives.

Each microphone picks up both ends through the frame, B = [[l1, 1-l1], [1-l2, l2]] A (the paper, Eq. 5), and
air-borne sound; a preamplifier limits its band and may distort; the converter adds noise and clips.
"""

import numpy as np

from monochord.physics.twin.jit import inlined
from monochord.physics.twin.records import (
    STAGE_CLIP,
    ChainParameters,
    CoilEffects,
    DriverParameters,
    DriverState,
    PickupParameters,
    PreampState,
)
from monochord.physics.twin.roughness import mixed_bits

UNIT = (12.0 / 8.0) ** 0.5 / 65536.0
"""Scales the sum of eight numbers of 16 bits to unit variance."""


@inlined
def saturated(x: float) -> float:
    """Return tanh(x) to 2e-7, and to 6e-4 beyond 8: two halves of its continued fraction (Lambert 1768)."""
    half = 0.5 * min(20.0, max(-20.0, x))
    y = half * half
    t = half * (10395.0 + y * (1260.0 + 21.0 * y)) / (10395.0 + y * (4725.0 + y * (210.0 + y)))
    return 2.0 * t / (1.0 + t * t)


@inlined
def drive(
    ebow: DriverParameters, memory: DriverState, velocity: float, coil: CoilEffects | None = None
) -> float:
    """Return the force in N held over the next step, given the velocity at the sense coil in m/s.

    `coil` is what makes it asymmetric, if anything does.
    """
    g, k = ebow.g, ebow.k
    high = (velocity - (k + g) * memory.first - memory.second) * ebow.scale
    band = g * high + memory.first
    low = g * band + memory.second
    memory.first = g * high + band
    memory.second = g * band + low
    output = k * band
    ahead = 1.5 * output - 0.5 * memory.output
    memory.output = output
    limit = ebow.limit
    if limit <= 0.0 or memory.gate <= 0.0:
        return 0.0
    if coil is not None:
        return memory.gate * limit * coil.scale * (saturated(ebow.gain * ahead + coil.bias) - coil.rest)
    return memory.gate * limit * saturated(ebow.gain * ahead)


@inlined
def magnet(coil: CoilEffects) -> float:
    """Return a magnet's force in N held over the next step: towards where the string already is."""
    return coil.pull * (1.5 * coil.place - 0.5 * coil.place_before)


@inlined
def mixed(pickup: PickupParameters, near: float, far: float, air: float) -> tuple[float, float]:
    """Return both microphones' signals in full scale, from the end forces in N and air-borne sound."""
    first = pickup.gain_1 * (pickup.own_1 * near + (1.0 - pickup.own_1) * far) + pickup.air_1 * air
    second = pickup.gain_2 * ((1.0 - pickup.own_2) * near + pickup.own_2 * far) + pickup.air_2 * air
    return first, second


@inlined
def amplified(pickup: PickupParameters, memory: PreampState, signal: float) -> float:
    """Return a signal after the preamplifier: a one-pole high-pass and a two-pole low-pass."""
    cut = pickup.low_cut
    step = (signal - memory.low_cut) * cut
    slow = memory.low_cut + step
    memory.low_cut = slow + step
    g, k = pickup.g, pickup.k
    high = (signal - slow - (k + g) * memory.first - memory.second) * pickup.scale
    band = g * high + memory.first
    low = g * band + memory.second
    memory.first = g * high + band
    memory.second = g * band + low
    return low


@inlined
def distorted(chain: ChainParameters, signal: float) -> float:
    """Return a signal after the stage before the converter, which bends it and clips."""
    x = min(STAGE_CLIP, max(-STAGE_CLIP, signal))
    return x + x * x * (chain.second + chain.third * x)


@inlined
def normal_noise(seed: int, index: int) -> float:
    """Return a number close to normal, of unit variance: the sum of eight uniform ones, by seed and index."""
    total = np.int64(0)
    for half in range(2):
        bits = mixed_bits(seed, index + half)
        for piece in range(4):
            total += np.int64((bits >> np.uint64(16 * piece)) & np.uint64(0xFFFF))
    return (np.float64(total) - 8.0 * 32767.5) * UNIT


@inlined
def converted(value: float) -> float:
    """Return a value as the converter gives it: clipped at full scale."""
    return min(1.0, max(-1.0, value))
