"""Compiled kernels: the leapfrog scheme node by node, and the free motion of many modes."""

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel
from monochord.core.types import Floats


@kernel(fastmath=False)
def leapfrog(
    now: Floats,
    before: Floats,
    coefficients: tuple[float, float, float],
    loads: Floats,
    signals: Floats,
    nodes: NDArray[np.int64],
    weights: Floats,
    motion: Floats,
) -> None:
    """Advance one segment in place; see `monochord.physics.split_string.grid.leapfrog`.

    There is no fast-math here: reassociated sums and fused products would break the agreement to rounding.
    """
    here, neighbours, past = coefficients
    first, last = loads[0], now.size - 1  # the end must be known outside, or the sweep is not vectorised
    for step in range(signals.shape[1]):
        for p in range(nodes.size):
            i, w = nodes[p], weights[p]
            motion[p, step] = (1.0 - w) * before[i] + w * before[i + 1]
        push = signals[0, step]
        # The first driver rides in the main sweep: a second sweep over its nodes would cost a fifth more.
        for i in range(1, last):
            before[i] = (
                here * now[i] + neighbours * (now[i - 1] + now[i + 1]) + past * before[i] + first[i] * push
            )
        for d in range(1, loads.shape[0]):
            for i in range(1, last):
                before[i] += loads[d, i] * signals[d, step]
        for p in range(nodes.size):
            i, w = nodes[p], weights[p]
            motion[p, step] = (1.0 - w) * before[i] + w * before[i + 1] - motion[p, step]
        now, before = before, now


@kernel(fastmath={"reassoc", "contract"})
def ring(propagator: Floats, shape: Floats, q: Floats, v: Floats, velocity: Floats) -> None:
    """Add the pickups' velocity by freely moving modes to `velocity`; advance `q` and `v` in place.

    `propagator` (4, modes) is from `free_motion` over one sample, `shape` (pickups, modes) each mode's value
    at a pickup, and `velocity` (pickups, samples) in m/s begins with the initial one. Sums over modes are
    reassociated, which changes them by rounding only, identically for any block size.
    """
    for sample in range(velocity.shape[1]):
        for p in range(shape.shape[0]):
            total = 0.0
            for m in range(q.size):
                total += shape[p, m] * v[m]
            velocity[p, sample] += total
        for m in range(q.size):
            old = q[m]
            q[m] = propagator[0, m] * old + propagator[1, m] * v[m]
            v[m] = propagator[2, m] * old + propagator[3, m] * v[m]
