"""Silence: the level below which a microphone picks up nothing, and the remedy."""

import numpy as np

from monochord.core.types import Audio

SILENT_LEVEL = 2.0e-5
"""Root mean square, without the mean, below which sound is silence: twice the rounding noise of 16 bits."""
SILENCE_REMEDY = (
    "check that a driver runs, that the gain is up, and that it is the right input (monochord list devices)"
)
"""Remedy for a silent input."""


def is_silent(samples: Audio) -> bool:
    """Return whether sound is silence; sound with non-finite samples is not.

    Parameters
    ----------
    samples
        One channel (n,), in full scale.

    Examples
    --------
    >>> is_silent(np.full(441, 0.1, np.float32)), is_silent(np.linspace(-0.1, 0.1, 441, dtype=np.float32))
    (True, False)
    """
    with np.errstate(invalid="ignore"):
        return bool(samples.std(dtype=np.float64) < SILENT_LEVEL)
