"""The sound of a small geared motor whose speed is given."""

import numpy as np

from monochord.core.types import Floats
from monochord.dsp.noise import band

GEAR_TEETH = 17
"""The gear mesh sounds at this multiple of the motor speed, and at its first harmonics."""


def geared_motor(stream: np.random.Generator, speed: Floats, sample_rate: float) -> Floats:
    """Return the sound (n,) of a motor at a speed (n,) in revolutions a second; its level is about two.

    Harmonics of its speed, the gear mesh, and noise from 1 to 6 kHz that the mesh modulates. Assumed: their
    levels.

    Examples
    --------
    >>> geared_motor(np.random.default_rng(0), np.full(4410, 30.0), 44100.0).shape
    (4410,)
    """
    phase = 2 * np.pi * np.cumsum(speed) / sample_rate
    lines = {**{k: 1.0 / k for k in range(1, 9)}, GEAR_TEETH: 0.8, 2 * GEAR_TEETH: 0.4, 3 * GEAR_TEETH: 0.2}
    waves = sum(
        (weight * np.sin(k * phase + stream.uniform(0.0, 2 * np.pi)) for k, weight in lines.items()),
        np.zeros(speed.size),
    )
    hiss = band(stream, (speed.size,), sample_rate, low=1000.0, high=6000.0)
    return waves + 0.4 * hiss * (1.0 + 0.5 * np.sin(GEAR_TEETH * phase))
