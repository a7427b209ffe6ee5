"""A segment on a grid of nodes, and the leapfrog scheme on it in readable NumPy."""

from collections.abc import Callable
from dataclasses import dataclass
from math import floor

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.physics.split_string.segments import (
    Segment,
    drive_density,
    gaussian_modes,
    pluck_amplitudes,
    split,
)
from monochord.physics.split_string.setup import SplitString
from monochord.physics.theory import step_limit

Kernel = Callable[
    [Floats, Floats, tuple[float, float, float], Floats, Floats, NDArray[np.int64], Floats, Floats], None
]

APPENDIX_STEP: Seconds = 1.0e-6
MAX_DIVISOR = 100
"""Relative to the appendix's step: finer grids take minutes for a second of sound."""


@dataclass(slots=True, kw_only=True)
class SegmentGrid:
    """One segment's displacements, now and one step before, with its constants; stepping changes it."""

    now: Floats
    before: Floats
    coefficients: tuple[float, float, float]
    loads: Floats
    nodes: NDArray[np.int64]
    weights: Floats
    channels: slice

    def step(self, kernel: Kernel, signals: Floats, motion: Floats) -> None:
        """Advance by as many steps as `signals` (2, n) has; `motion` (2, n) receives y(n+1) - y(n-1) in m.

        Only this segment's channels are driven and written.
        """
        drives, out = signals[self.channels], motion[self.channels]
        kernel(self.now, self.before, self.coefficients, self.loads, drives, self.nodes, self.weights, out)
        if signals.shape[1] % 2:
            self.now, self.before = self.before, self.now


def lay_out(setup: SplitString, segment: Segment) -> SegmentGrid:
    """Return a segment on its grid at time zero; raises `InputError` for an unstable step."""
    dt, count = time_step(setup), setup.nodes
    places = np.linspace(0.0, segment.length, count)
    loss = segment.decay_rate * dt / 2.0
    courant = (segment.speed * dt / segment.spacing) ** 2
    coefficients = (2.0 - 2.0 * courant, courant, loss - 1.0)
    now, before = _aligned(count), _aligned(count)
    now[1:-1] = _initial(setup, segment, places)[1:-1]
    # At rest at time zero: y(-dt) by Taylor's series to second order.
    before[1:-1] = now[1:-1] + courant / 2.0 * (now[2:] - 2.0 * now[1:-1] + now[:-2])
    loads = _aligned(len(segment.drivers) * count).reshape(-1, count)
    for load, place in zip(loads, segment.drivers, strict=True):
        load[:] = drive_density(setup.drive, segment, place, places)
    loads *= dt**2 / (segment.linear_density * (1.0 + loss))
    pickup_at = np.array(segment.pickups) / segment.spacing
    nodes = np.minimum(pickup_at.astype(np.int64), count - 2)
    return SegmentGrid(
        now=now,
        before=before,
        coefficients=(
            coefficients[0] / (1.0 + loss),
            coefficients[1] / (1.0 + loss),
            coefficients[2] / (1.0 + loss),
        ),
        loads=loads,
        nodes=nodes,
        weights=pickup_at - nodes,
        channels=segment.channels,
    )


def time_step(setup: SplitString) -> Seconds:
    """Return the time step of both segments in s: from the setup, or a stable one.

    A step is stable below alpha dxi / v (Eq. 13) on every segment. Where the setup has none, it is 1 us
    divided by the smallest integer that makes it stable: then the drivers' interval is an integer number of
    steps, and they sense at the same rate on any string.

    Raises
    ------
    InputError
        If the setup's step is unstable, or a stable one would be below 10 ns.
    """
    segment = min(split(setup), key=lambda each: each.spacing / each.speed)
    limit = step_limit(segment.spacing, segment.speed, setup.alpha)
    parts = floor(APPENDIX_STEP / limit) + 1
    if setup.time_step is None:
        if parts <= MAX_DIVISOR:
            return APPENDIX_STEP / parts
        given = f"a grid that needs steps below {limit:.4g} s"
        remedy = "set fewer nodes, or use --route modal"
        raise InputError(given, f"steps of {APPENDIX_STEP / MAX_DIVISOR:g} s or more", remedy)
    if setup.time_step >= limit:
        coarsest = int(1 + setup.alpha * segment.length / (segment.speed * setup.time_step))
        raise InputError(
            f"time step {setup.time_step:g} s",
            f"below {limit:.4g} s = {setup.alpha:g} dxi/v on the segment of {segment.length:g} m",
            f"--set time_step={APPENDIX_STEP / parts:.3g}, at most {coarsest} nodes, or --route modal",
        )
    return setup.time_step


def _initial(setup: SplitString, segment: Segment, places: Floats) -> Floats:
    if setup.initial == "rest":
        return np.zeros_like(places)
    count = gaussian_modes(setup.pluck.width, segment.length)
    shapes = np.sin(np.outer(places, np.arange(1, count + 1)) * np.pi / segment.length)
    return shapes @ pluck_amplitudes(setup.pluck, segment, count)


def _aligned(count: int) -> Floats:
    """Return zeros whose element 1, where the sweep begins, starts a cache line: an eighth faster on x86."""
    line = 64 // 8
    store = np.zeros(count + 2 * line)
    skip = (-(store.ctypes.data // 8) - 1) % line
    return store[skip : skip + count]


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
    """Advance one segment in place by as many steps as `signals` has columns.

    With s = gamma dt / 2 and l = v dt / dxi, the central differences of Eq. 10 give::

        (1 + s) y_i(n+1) = (2 - 2 l^2) y_i + l^2 (y_(i-1) + y_(i+1)) - (1 - s) y_i(n-1) + dt^2 f_i / mu,

    second order in both steps, stable for l <= 1 (Yi, Xing, Manchester and Fazeli, Sound of Touch, Eq. 10 and
    13; Bilbao, Numerical Sound Synthesis (2009), section 6.2). The two outermost nodes are never written:
    they are fixed. `now` and `before` (nodes,) are displacements in m; they swap roles at each step: after an
    odd number of steps, the newest is in `before`. `coefficients` are those of y_i, of its neighbours' sum
    and of y_i(n-1), each over 1 + s; `loads` (drivers, nodes) is dt^2 f_i / (mu (1 + s)) in m at full swing,
    and `signals` (drivers, steps) are between -1 and 1. A pickup senses (1 - weight) of its node and weight
    of the next; `motion` (pickups, steps) receives y(n+1) - y(n-1) there, in m.

    At l = 1 and without loss the scheme shifts a shape by exactly one node a step:

    >>> now, before = np.zeros(6), np.zeros(6)
    >>> now[2], before[1] = 1.0, 1.0
    >>> leapfrog(now, before, (0.0, 1.0, -1.0), np.zeros((1, 6)), np.zeros((1, 1)),
    ...          np.array([3]), np.array([0.0]), motion := np.zeros((1, 1)))
    >>> before, motion
    (array([0., 0., 0., 1., 0., 0.]), array([[1.]]))
    """
    here, neighbours, past = coefficients
    for step in range(signals.shape[1]):
        old = (1.0 - weights) * before[nodes] + weights * before[nodes + 1]
        inner = here * now[1:-1] + neighbours * (now[:-2] + now[2:]) + past * before[1:-1]
        for load, signal in zip(loads, signals[:, step], strict=True):
            inner += load[1:-1] * signal
        before[1:-1] = inner
        motion[:, step] = (1.0 - weights) * before[nodes] + weights * before[nodes + 1] - old
        now, before = before, now
