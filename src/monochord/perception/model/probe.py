"""Probe windows: a feature's values for them identify its code and weights."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Samples
from monochord.perception.features.base import Extractor

MAX_DIFFERENCE = 0.1
"""Largest median difference of an unchanged feature's values, in standard deviations of the training."""


def probe_windows(channels: int, size: Samples) -> Audio:
    """Return three fixed windows (3, channels, size): a chord, noise, and both with a decay.

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
    """Return the features (3, columns) of the probe windows."""
    return extractor(probe_windows(channels, size))


def refuse_another(name: str, values: Audio, trained: Audio, scale: Audio) -> None:
    """Refuse a feature whose values (3, columns) for the probe windows differ from those in training.

    The median difference counts, over the training's standard deviation `scale` (columns,), so a single peak
    that another machine picks differently is tolerated.
    """
    difference = float(np.median(np.abs(values - trained) / scale))
    if not difference < MAX_DIFFERENCE:
        given = f"feature '{name}', which differs from the training by {difference:.2g} standard deviations"
        raise InputError(given, "the code and weights of the training", "restore them, or train again")
