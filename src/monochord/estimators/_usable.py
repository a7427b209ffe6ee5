"""Whether a window can be used at all, before anything is estimated from it."""

import math

import numpy as np

from monochord.types import Window

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
    samples = window.samples
    low, high = float(samples.min()), float(samples.max())
    if not (math.isfinite(low) and math.isfinite(high)):  # either is NaN where any sample is
        return "samples that are not numbers"
    if samples.std(axis=1, dtype=np.float64).max() < SILENCE:
        return "silence"
    rails = np.count_nonzero(samples == high) + np.count_nonzero(samples == low)
    if rails > CLIPPED_SHARE * samples.size:
        return "clipped"
    return ""
