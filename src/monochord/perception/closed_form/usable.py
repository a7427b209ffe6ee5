"""Whether a window can be used at all, before anything is estimated from it."""

import math

import numba
import numpy as np

from monochord.core.types import Audio, Window

SILENCE = 2.0e-5
"""Root mean square below which a window is silence: twice the rounding noise of 16 bit."""
CLIPPED_SHARE = 0.1
"""Share of samples at the very top and bottom values from which a window is too clipped to trust."""


def why_unusable(window: Window) -> str:
    """Return why a window cannot be used, or an empty string.

    >>> quiet = Window(samples=np.zeros((2, 4410), np.float32), start=0, sample_rate=44100)
    >>> why_unusable(quiet)
    'silence'
    """
    if window.has_gap:
        return "gap"
    deviation, extreme = _measured(window.samples)
    if not math.isfinite(deviation):
        return "samples that are not numbers"
    if deviation < SILENCE:
        return "silence"
    if extreme > CLIPPED_SHARE:
        return "clipped"
    return ""


@numba.njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def _measured(samples: Audio) -> tuple[float, float]:
    """Return the largest standard deviation of a channel, and the share of samples at the extreme values."""
    low = high = samples[0, 0]
    deviation = 0.0
    for channel in samples:
        total = square = 0.0
        for sample in channel:
            total += sample
            low, high = min(low, sample), max(high, sample)
        mean = total / channel.size
        if not np.isfinite(mean):
            return np.nan, 0.0
        for sample in channel:
            square += (sample - mean) ** 2
        deviation = max(deviation, np.sqrt(square / channel.size))
    extreme = 0
    for channel in samples:
        for sample in channel:
            extreme += (sample == low) | (sample == high)
    return deviation, extreme / samples.size
