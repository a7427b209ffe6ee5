"""The leapfrog scheme compiled: the same arithmetic in the same order as the reference, node by node."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from monochord.core.types import Floats


@njit(cache=True, error_model="numpy", fastmath=False)
def leapfrog(
    now: Floats,
    before: Floats,
    coefficients: tuple[float, float, float],
    loads: Floats,
    signals: Floats,
    nodes: NDArray[np.int64],
    weights: Floats,
    heard: Floats,
) -> None:
    """Advance one segment in place; see `monochord.physics.split_string.reference.leapfrog`.

    No fast-math here: reassociated sums and fused products would end the agreement to rounding.
    """
    own, neighbours, past = coefficients
    first, last = loads[0], now.size - 1  # the end must be known outside, or the sweep is not vectorised
    for step in range(signals.shape[1]):
        for p in range(nodes.size):
            i, w = nodes[p], weights[p]
            heard[p, step] = (1.0 - w) * before[i] + w * before[i + 1]
        push = signals[0, step]
        # The first driver rides in the main sweep: a second sweep over its nodes would cost a fifth more.
        for i in range(1, last):
            before[i] = (
                own * now[i] + neighbours * (now[i - 1] + now[i + 1]) + past * before[i] + first[i] * push
            )
        for d in range(1, loads.shape[0]):
            for i in range(1, last):
                before[i] += loads[d, i] * signals[d, step]
        for p in range(nodes.size):
            i, w = nodes[p], weights[p]
            heard[p, step] = (1.0 - w) * before[i] + w * before[i + 1] - heard[p, step]
        now, before = before, now
