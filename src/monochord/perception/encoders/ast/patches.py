"""How the transformer cuts a log-mel spectrogram into patches."""

from monochord.core.errors import InputError

BINS = 128
"""Mel bands of a spectrogram."""
PATCH = 16
"""Bands, and frames, of a patch."""
STRIDE = 10
"""Bands, and frames, from patch to patch."""
ROWS = (BINS - PATCH) // STRIDE + 1
MEAN, DEVIATION = -4.2677393, 4.5689974
"""Of log-mel energies in AudioSet."""


def columns_of(frames: int) -> int:
    """Return how many patches lie side by side in time; raises `InputError` where there is not one.

    Examples
    --------
    >>> columns_of(100), columns_of(1024)
    (9, 101)
    """
    if frames < PATCH:
        raise InputError(f"a spectrogram of {frames} frames", f"{PATCH} frames or more")
    return (frames - PATCH) // STRIDE + 1
