"""From a log-mel spectrogram to the patches that the transformer sees."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio

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


def patches_of(energies: Audio) -> Audio:
    """Return the patches of log-mel energies, normalised as in training: (e - mean) / (2 deviation).

    Parameters
    ----------
    energies
        (channels, frames, 128), natural logarithms, as `monochord.dsp.mel.LogMel` gives them.

    Returns
    -------
    Audio
        (channels, 12 columns, 256) float32: the patches row by row, lowest bands first, each row in the order
        of time; a patch's own numbers band by band.

    Raises
    ------
    InputError
        If the energies have another number of bands, or too few frames.

    Examples
    --------
    >>> patches_of(np.zeros((2, 100, 128), np.float32)).shape
    (2, 108, 256)
    """
    channels, frames, bins = energies.shape
    if bins != BINS:
        raise InputError(f"a spectrogram of {bins} bands", f"{BINS} bands")
    columns = columns_of(frames)
    even = (energies.transpose(0, 2, 1) - np.float32(MEAN)) / np.float32(2.0 * DEVIATION)
    views = np.lib.stride_tricks.sliding_window_view(even, (PATCH, PATCH), axis=(1, 2))
    chosen = views[:, ::STRIDE, ::STRIDE]
    return np.ascontiguousarray(chosen.reshape(channels, ROWS * columns, PATCH * PATCH), np.float32)
