"""Silence: the level below which a microphone picks up nothing."""

import numpy as np

from monochord.core.types import Audio

SILENT_LEVEL = 2.0e-5
"""Root mean square, without the mean, below which sound is silence: twice the rounding noise of 16 bits."""


def is_silent(samples: Audio) -> bool:
    """Return whether sound is silence; sound with non-finite samples is not.

    `samples` are one channel (n,), in full scale.

    >>> is_silent(np.full(441, 0.1, np.float32)), is_silent(np.linspace(-0.1, 0.1, 441, dtype=np.float32))
    (True, False)
    """
    with np.errstate(invalid="ignore"):
        return bool(samples.std(dtype=np.float64) < SILENT_LEVEL)
