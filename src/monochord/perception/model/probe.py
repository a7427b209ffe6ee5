"""Made-up windows that tell what a feature does, wherever its code and its weights may stand."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Samples
from monochord.perception.features.base import Extractor

UNLIKE = 0.1
"""Median difference of its values, in deviations of the training, from which a feature is another one."""


def made_up(channels: int, size: Samples) -> Audio:
    """Return three windows (3, channels, size): a chord, noise, and both fading; the same everywhere.

    >>> made_up(2, 4410).shape
    (3, 2, 4410)
    """
    rng = np.random.default_rng(0)
    time = np.arange(size) / size
    chord = sum(np.sin(2.0 * np.pi * (37.0 * n + 0.3) * time) / n for n in (1, 2, 3, 5))
    noise = rng.standard_normal(size)
    made = np.stack([chord, noise, (chord + 0.01 * noise) * np.exp(-3.0 * time)])
    levels = np.linspace(0.2, 0.1, channels)[:, None]
    return (levels * made[:, None, :]).astype(np.float32)


def probed(extractor: Extractor, channels: int, size: Samples) -> Audio:
    """Return what a feature makes of the made-up windows (3, columns)."""
    return extractor(made_up(channels, size))


def refuse_another(name: str, found: Audio, kept: Audio, scale: Audio) -> None:
    """Refuse a feature that answers the made-up windows otherwise than it did in training.

    It is the median that counts: a peak that another machine picks otherwise makes no other feature.

    Parameters
    ----------
    name
        Of the feature.
    found, kept
        What it answers now, and what it answered then (3, columns).
    scale
        Standard deviations of the columns in training.

    Raises
    ------
    InputError
        If it is another feature.
    """
    off = float(np.median(np.abs(found - kept) / scale))
    if not off < UNLIKE:
        given = f"feature '{name}', which is not what it was in training ({off:.2g} deviations off)"
        raise InputError(given, "the same code and weights", "go back to those, or train again")
