"""Whether a window can be used at all, before anything is estimated from it."""

import math

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.silence import SILENT_LEVEL
from monochord.core.types import Audio, Window

CLIPPED_SHARE = 0.1
"""Share of samples at the very top and bottom values from which a window is too clipped to trust."""


def unusable_reason(window: Window) -> str:
    """Return why a window cannot be used, or an empty string.

    >>> quiet = Window(samples=np.zeros((2, 4410), np.float32), start=0, sample_rate=44100)
    >>> unusable_reason(quiet)
    'silence'
    """
    if window.has_gap:
        return "gap"
    deviation, extreme = _measured(window.samples)
    if not math.isfinite(deviation):
        return "samples that are not numbers"
    if deviation < SILENT_LEVEL:
        return "silence"
    if extreme > CLIPPED_SHARE:
        return "clipped"
    return ""


@kernel(fastmath={"reassoc"})
def _measured(samples: Audio) -> tuple[float, float]:
    """Return the largest standard deviation of a channel, and the share of samples at the extreme values.

    Samples are indexed, since of a channel as an iterator LLVM takes only one at a time.
    """
    channels, size = samples.shape
    deviation = 0.0
    for c in range(channels):
        total = square = 0.0
        for i in range(size):
            total += samples[c, i]
        mean = total / size
        if not np.isfinite(mean):
            return np.nan, 0.0
        for i in range(size):
            square += (samples[c, i] - mean) ** 2
        deviation = max(deviation, np.sqrt(square / size))
    low, high = _extremes(samples)
    extreme = 0
    for c in range(channels):
        for i in range(size):
            extreme += (samples[c, i] == low) | (samples[c, i] == high)
    return deviation, extreme / samples.size


@part(fastmath={"nnan", "nsz"})
def _extremes(samples: Audio) -> tuple[float, float]:
    """Return the lowest and the highest sample; all are numbers."""
    low = high = samples[0, 0]
    for c in range(samples.shape[0]):
        for i in range(samples.shape[1]):
            low, high = min(low, samples[c, i]), max(high, samples[c, i])
    return low, high
