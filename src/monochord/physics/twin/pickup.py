"""From the forces at the string's ends to the two channels of the converter.

Each microphone hears both ends through the frame, B = [[l1, 1-l1], [1-l2, l2]] A (the paper, Eq. 5), and
air-borne sound besides; a preamplifier passes its band; the converter adds its noise and clips.
"""

import numpy as np

from monochord.core.types import Floats
from monochord.physics.twin.part import part
from monochord.physics.twin.roughness import mixed_bits

OWN_1, OWN_2, GAIN_1, GAIN_2, LOW_CUT, HIGH_WARP, HIGH_DAMP, HISS, AIR_1, AIR_2, SCALE = range(11)
"""Parameters: mixing, gain to full scale a newton, filters, rms of the converter's noise, share of
air-borne sound, and 1 / (1 + g (g + k)) of the high cut."""
CUT, FIRST, SECOND = range(3)
"""Memory of one channel: the low cut's state and the two of the high cut."""
UNIT = (12.0 / 8.0) ** 0.5 / 65536.0
"""Brings the sum of eight numbers of 16 bits to unit variance."""


@part
def bell(seed: int, index: int) -> float:
    """Return a number close to normal, of unit variance: eight uniform ones, by seed and two indices."""
    total = np.int64(0)
    for half in range(2):
        bits = mixed_bits(seed, index + half)
        for piece in range(4):
            total += np.int64((bits >> np.uint64(16 * piece)) & np.uint64(0xFFFF))
    return (np.float64(total) - 8.0 * 32767.5) * UNIT


@part
def amplified(pickup: Floats, memory: Floats, signal: float) -> float:
    """Return a signal after the preamplifier's band: one pole from below, two from above."""
    cut = pickup[LOW_CUT]
    step = (signal - memory[CUT]) * cut
    slow = memory[CUT] + step
    memory[CUT] = slow + step
    g, k = pickup[HIGH_WARP], pickup[HIGH_DAMP]
    high = (signal - slow - (k + g) * memory[FIRST] - memory[SECOND]) * pickup[SCALE]
    band = g * high + memory[FIRST]
    low = g * band + memory[SECOND]
    memory[FIRST] = g * high + band
    memory[SECOND] = g * band + low
    return low


@part
def converted(value: float) -> float:
    """Return a value as the converter gives it: clipped at full scale."""
    return min(1.0, max(-1.0, value))


@part
def mixed(pickup: Floats, near: float, far: float, air: float) -> tuple[float, float]:
    """Return what the two microphones hear of the end forces in N and of air-borne sound, in full scale."""
    first = pickup[GAIN_1] * (pickup[OWN_1] * near + (1.0 - pickup[OWN_1]) * far) + pickup[AIR_1] * air
    second = pickup[GAIN_2] * ((1.0 - pickup[OWN_2]) * near + pickup[OWN_2] * far) + pickup[AIR_2] * air
    return first, second
