"""Reduces long curves to few points, for plots."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats

MAX_POINTS = 4000
"""Most points of a curve; longer curves keep the extremes of each stretch."""

Value = TypeVar("Value", np.float32, np.float64)


def thinned(time: Floats, values: NDArray[Value]) -> tuple[Floats, NDArray[Value]]:
    """Return a curve (n,) with at most `MAX_POINTS` points, keeping every peak.

    >>> time = np.arange(10_000.0)
    >>> thinned(time, np.where(time == 5000.0, 1.0, 0.0))[1].max()
    np.float64(1.0)
    """
    size = -(-len(time) // (MAX_POINTS // 2))
    if size <= 2:
        return time, values
    count = len(time) // size
    parts = values[: count * size].reshape(count, size)
    ends = np.stack([parts.min(axis=1), parts.max(axis=1)], axis=1)
    return np.repeat(time[: count * size : size], 2), ends.ravel()
