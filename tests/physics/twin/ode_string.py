"""An oracle: the first modes of a touched and driven string, an initial value problem to a tight tolerance.

    m q'' + 2 m sigma_n q' + m w_n^2 q = forces on phi_n = sin(n pi x / L),   m = mu L / 2,

with the static compliance R of the modes left out in series with the touch: the compression delta satisfies
delta + R f_e(delta) = g, where g = d - sum q_n phi_n(x_c) and f_e = k1 delta + k2 delta^1.5, and the touch's
force is f_e (1 + beta ddelta/dt), never below 0. Modes, and how touch and coils meet them, are arrays: any
aperture will do.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from monochord.core.types import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Modes:
    """Length L in m, density mu in kg/m, tension T and stretch EA in N; w_n in rad/s and sigma_n in 1/s."""

    length: float
    density: float
    tension: float
    omega: Floats  # (N,)
    sigma: Floats  # (N,)
    stretch: float = 0.0

    @property
    def mass(self) -> float:
        """The modal mass mu L / 2."""
        return self.density * self.length / 2.0

    @property
    def numbers(self) -> Floats:
        """1 to N."""
        return np.arange(1.0, self.omega.size + 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModalTouch:
    """`shape` is phi_n(x_c), (N,); `residual` R in m/N; `surface` d in m, at rest."""

    shape: Floats
    k1: float
    k2: float = 0.0
    beta: float = 0.0
    residual: float = 0.0
    surface: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ModalEBow:
    """A driver: the velocity at the sense coil, through a band-pass, y; then F_max tanh(g y / F_max).

    `sense` and `drive` are phi_n at the coils, (N,). The filter's gain is 1 at `centre` in Hz;
    `quality` is Q. `gain` g is in N s/m, `max_force` in N.
    """

    sense: Floats
    drive: Floats
    gain: float
    max_force: float
    centre: float
    quality: float


class ModalMotion(NamedTuple):
    """What the modes did, at the samples of the rate that was asked for."""

    time: Floats  # (n,) s
    q: Floats  # (N, n) m
    v: Floats  # (N, n) m/s
    touch_force: Floats  # (n,) N


def shapes(modes: Modes, x: float) -> Floats:
    """Return phi_n(x), (N,)."""
    return np.sin(np.pi * modes.numbers * x / modes.length)


def simulate(
    modes: Modes,
    *,
    touch: ModalTouch | None = None,
    ebows: Sequence[ModalEBow] = (),
    q: Floats | None = None,
    v: Floats | None = None,
    seconds: float,
    rate: float = 44100.0,
    rtol: float = 1e-11,
    max_step: float | None = None,
) -> ModalMotion:
    """Let the modes go from `q` and `v`, each zero unless given; no step is above a sample."""
    count, bows = modes.omega.size, len(ebows)
    start = np.zeros(2 * count + 2 * bows)
    start[:count] = 0.0 if q is None else q
    start[count : 2 * count] = 0.0 if v is None else v
    slow = float(modes.omega[0])
    atol = 1e-15 * np.concatenate([np.ones(count), modes.omega, np.full(bows, slow), np.ones(bows)])
    time = np.arange(round(seconds * rate)) / rate
    solution = solve_ivp(
        _rates(modes, touch, ebows),
        (0.0, time[-1]),
        start,
        method="DOP853",
        t_eval=time,
        rtol=rtol,
        atol=atol,
        max_step=max_step or 1.0 / rate,
    )
    if not solution.success:
        raise ArithmeticError(solution.message)
    found_q, found_v = solution.y[:count], solution.y[count : 2 * count]
    return ModalMotion(time=time, q=found_q, v=found_v, touch_force=_touch_forces(touch, found_q, found_v))


def compression(touch: ModalTouch, gap: float) -> float:
    """Return delta with delta + R (k1 delta + k2 delta^1.5) = `gap`, or 0 where nothing touches.

    Newton's rule in s = sqrt(delta), from above, where the cubic is convex: it falls towards the root.
    """
    if gap <= 0.0:
        return 0.0
    square, cube = 1.0 + touch.residual * touch.k1, touch.residual * touch.k2
    s = sqrt(gap / square)
    for _ in range(60):
        less = (s * s * (square + cube * s) - gap) / (s * (2.0 * square + 3.0 * cube * s))
        s -= less
        if less <= 1e-15 * s:
            break
    return s * s


def _press(touch: ModalTouch, q: Floats, v: Floats) -> float:
    delta = compression(touch, touch.surface - float(touch.shape @ q))
    if delta == 0.0:
        return 0.0
    share = 1.0 + touch.residual * (touch.k1 + 1.5 * touch.k2 * sqrt(delta))
    squeeze = -float(touch.shape @ v) / share
    return max(0.0, (touch.k1 * delta + touch.k2 * delta * sqrt(delta)) * (1.0 + touch.beta * squeeze))


def _touch_forces(touch: ModalTouch | None, q: Floats, v: Floats) -> Floats:
    if not touch:
        return np.zeros(q.shape[1])
    return np.array([_press(touch, *now) for now in zip(q.T, v.T, strict=True)])


def _rates(
    modes: Modes, touch: ModalTouch | None, ebows: Sequence[ModalEBow]
) -> Callable[[float, Floats], Floats]:
    """Return the right-hand side for q, v, y, z; a driver has y' = (w0 / Q) (s - y) - w0^2 z and z' = y."""
    count, bows, mass = modes.omega.size, len(ebows), modes.mass
    spring, loss, squares = modes.omega**2, 2.0 * modes.sigma, modes.numbers**2
    pull = modes.stretch * np.pi**2 / (4.0 * modes.length**2) * np.pi**2 / (2.0 * modes.length * mass)
    sense = np.array([e.sense for e in ebows]).reshape(bows, count)
    drive = np.array([e.drive for e in ebows]).reshape(bows, count) / mass
    w0 = 2.0 * np.pi * np.array([e.centre for e in ebows])
    width = w0 / np.array([e.quality for e in ebows])
    gain, limit = np.array([e.gain for e in ebows]), np.array([e.max_force for e in ebows])

    def rates(_: float, state: Floats) -> Floats:
        q, v = state[:count], state[count : 2 * count]
        change = np.empty_like(state)
        change[:count] = v
        a = -spring * q - loss * v
        if pull:
            a -= pull * (squares @ (q * q)) * squares * q
        if touch:
            a += _press(touch, q, v) / mass * touch.shape
        if bows:
            y, z = state[2 * count : 2 * count + bows], state[2 * count + bows :]
            a += (limit * np.tanh(gain * y / limit)) @ drive
            change[2 * count : 2 * count + bows] = width * (sense @ v - y) - w0 * w0 * z
            change[2 * count + bows :] = y
        change[count : 2 * count] = a
        return change

    return rates
