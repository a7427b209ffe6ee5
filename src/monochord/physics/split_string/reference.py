"""The leapfrog scheme in NumPy, to be read; the compiled kernel agrees with it to rounding."""

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats


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
    """Advance one segment in place by as many steps as `signals` has columns.

    With s = gamma dt / 2 and l = v dt / dxi, the central differences of Eq. 10 give

        (1 + s) y_i(n+1) = (2 - 2 l^2) y_i + l^2 (y_(i-1) + y_(i+1)) - (1 - s) y_i(n-1) + dt^2 f_i / mu,

    second order in both steps, stable for l <= 1. The two outermost nodes are never written: they are fixed.

    Parameters
    ----------
    now, before
        Displacements (nodes,) in m at this step and the one before. They change roles at each step: after an
        odd number of steps the newest is in `before`.
    coefficients
        Of y_i, of its neighbours' sum and of y_i(n-1), each divided by 1 + s.
    loads
        (drivers, nodes): dt^2 f_i / (mu (1 + s)) in m for a driver at full swing.
    signals
        (drivers, steps): what the drivers play, between -1 and 1.
    nodes, weights
        (pickups,): a pickup hears (1 - weight) of its node and weight of the next.
    heard
        (pickups, steps): receives y(n+1) - y(n-1) at the pickups, in m.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, Eq. 10 and 13; Bilbao, Numerical Sound Synthesis (2009),
    section 6.2.

    Examples
    --------
    At l = 1 and without loss the scheme shifts a shape by exactly one node a step:

    >>> now, before = np.zeros(6), np.zeros(6)
    >>> now[2], before[1] = 1.0, 1.0
    >>> leapfrog(now, before, (0.0, 1.0, -1.0), np.zeros((1, 6)), np.zeros((1, 1)),
    ...          np.array([3]), np.array([0.0]), heard := np.zeros((1, 1)))
    >>> before, heard
    (array([0., 0., 0., 1., 0., 0.]), array([[1.]]))
    """
    own, neighbours, past = coefficients
    for step in range(signals.shape[1]):
        old = (1.0 - weights) * before[nodes] + weights * before[nodes + 1]
        inner = own * now[1:-1] + neighbours * (now[:-2] + now[2:]) + past * before[1:-1]
        for load, signal in zip(loads, signals[:, step], strict=True):
            inner += load[1:-1] * signal
        before[1:-1] = inner
        heard[:, step] = (1.0 - weights) * before[nodes] + weights * before[nodes + 1] - old
        now, before = before, now
