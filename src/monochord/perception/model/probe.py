"""Probe windows: they identify what a feature computes, wherever its code and weights are."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Samples
from monochord.perception.features.base import Extractor

MAX_DIFFERENCE = 0.1
"""Median difference of a feature's values, in deviations of the training, below which it is the same."""


def probe_windows(channels: int, size: Samples) -> Audio:
    """Return three windows (3, channels, size): a chord, noise, and both fading; the same everywhere.

    >>> probe_windows(2, 4410).shape
    (3, 2, 4410)
    """
    rng = np.random.default_rng(0)
    time = np.arange(size) / size
    chord = sum(np.sin(2.0 * np.pi * (37.0 * n + 0.3) * time) / n for n in (1, 2, 3, 5))
    noise = rng.standard_normal(size)
    windows = np.stack([chord, noise, (chord + 0.01 * noise) * np.exp(-3.0 * time)])
    levels = np.linspace(0.2, 0.1, channels)[:, None]
    return (levels * windows[:, None, :]).astype(np.float32)


def probed(extractor: Extractor, channels: int, size: Samples) -> Audio:
    """Return the feature (3, columns) of the probe windows."""
    return extractor(probe_windows(channels, size))


def refuse_another(name: str, values: Audio, trained: Audio, scale: Audio) -> None:
    """Refuse a feature whose values for the probe windows are not those of the training.

    The median is compared, since a peak that another machine picks otherwise makes no other feature.

    Parameters
    ----------
    name
        Of the feature.
    values, trained
        Its values now and in training (3, columns).
    scale
        Standard deviations of the columns in training.

    Raises
    ------
    InputError
        If it is another feature.
    """
    difference = float(np.median(np.abs(values - trained) / scale))
    if not difference < MAX_DIFFERENCE:
        given = f"feature '{name}', changed since the training by {difference:.2g} deviations"
        raise InputError(given, "the same code and weights", "go back to those, or train again")
