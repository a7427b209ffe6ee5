"""Whether a window can be used at all, before anything is estimated from it."""

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
    if not np.isfinite(samples).all():
        return "samples that are not numbers"
    level = np.abs(samples - samples.mean(axis=1, keepdims=True, dtype=np.float64))
    if np.sqrt(np.mean(level**2, axis=1)).max() < SILENCE:
        return "silence"
    rails = (samples == samples.max()) | (samples == samples.min())
    if rails.mean() > CLIPPED_SHARE:
        return "clipped"
    return ""
