"""An oracle: a touched and driven string on a grid, by finite differences in space and time.

    mu u_tt = T_eff u_xx - EI u_xxxx - 2 mu sigma0 u_t + 2 mu sigma1 u_txx + point forces,   hinged ends,
    T_eff = T + EA / (2 L) integral u_x^2 dx.

Displacements stand at whole time steps, velocities at half steps: leapfrog, of order 2 in the step and the
spacing h. The losses sigma0 and beta are centred, and so is the drivers' filter, whose input stands just
between two of its outputs. A point force is shared by the two nodes beside it, and a displacement between
nodes is read with the same weights. A force a h beyond a node, with 0 < a < 1, meets a string that gives way
too little, by a (1 - a) h / T in m/N: put touches on nodes where that matters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from numba import njit

from monochord.core.types import Floats

Indices: TypeAlias = npt.NDArray[np.int64]
Curve: TypeAlias = Callable[[Floats], Floats]
Place: TypeAlias = float | tuple[Floats, Floats]
"""A point in m; or an aperture as points in m and their weights, of sum 1."""


def nowhere(x: Floats) -> Floats:
    """Zero everywhere: a string at rest, or a surface at the string's own height."""
    return np.zeros_like(x)


@dataclass(frozen=True, slots=True, kw_only=True)
class GridString:
    """Length L in m, density mu in kg/m, tension T in N, bending EI in N m^2, stretch EA in N, sigma0 in 1/s
    and sigma1 in m^2/s."""

    length: float
    density: float
    tension: float
    bending: float = 0.0
    stretch: float = 0.0
    sigma0: float = 0.0
    sigma1: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class GridTouch:
    """An object at `position` that presses with f = (k1 delta + k2 delta^1.5) (1 + beta delta').

    The compression delta is `surface(t)` - u(position) where that is positive, and f is never below 0.
    """

    position: float
    k1: float
    k2: float = 0.0
    beta: float = 0.0
    surface: Curve = nowhere


@dataclass(frozen=True, slots=True, kw_only=True)
class GridEBow:
    """A driver: the velocity at `sense`, through a band-pass, y; then F_max tanh(g y / F_max) at `drive`.

    The filter's gain is 1 at `centre` in Hz; `quality` is Q. `gain` g is in N s/m, `max_force` in N.
    """

    sense: Place
    drive: Place
    gain: float
    max_force: float
    centre: float
    quality: float


class GridMotion(NamedTuple):
    """What the string did, at the samples of the rate that was asked for."""

    time: Floats  # (n,) s
    pickups: Floats  # (2, n) N: T u_x at the near end, -T u_x at the far end
    displacement: Floats  # (probes, n) m
    velocity: Floats  # (probes, n) m/s
    touch_force: Floats  # (n,) N
    drive_forces: Floats  # (ebows, n) N
    shape: Floats  # (segments + 1,) m, after the last step


def simulate(
    string: GridString,
    *,
    touch: GridTouch | None = None,
    ebows: Sequence[GridEBow] = (),
    shape: Curve = nowhere,
    velocity: Curve = nowhere,
    seconds: float,
    rate: float = 44100.0,
    segments: int = 200,
    oversampling: int = 8,
    probes: Sequence[Place] = (),
) -> GridMotion:
    """Let the string go from `shape(x)` and `velocity(x)`, and tell what it does.

    It takes `oversampling` steps a sample; samples are picked, not averaged. Raises ValueError where the grid
    is too fine for the step, given the touch's stiffness and the tension as they are at each step.
    """
    spacing, step = string.length / segments, 1.0 / (rate * oversampling)
    samples = round(seconds * rate)
    x = spacing * np.arange(segments + 1.0)
    u, v = np.zeros(segments + 3), np.zeros(segments + 3)  # one node more beyond each end
    u[2:-2], v[2:-2] = shape(x)[1:-1], velocity(x)[1:-1]

    pressed = touch or GridTouch(position=string.length / 2, k1=0.0)
    places = [pressed.position, *(e.sense for e in ebows), *(e.drive for e in ebows), *probes]
    weights = np.stack([_weights(place, spacing, segments) for place in places])
    spans = np.array([(row.nonzero()[0][0], row.nonzero()[0][-1] + 1) for row in weights])
    t = step * np.arange(float(samples * oversampling))
    surface = pressed.surface(t)
    surface_velocity = (pressed.surface(t + step) - pressed.surface(t - step)) / (2.0 * step)

    mu = string.density
    law = np.array(
        [string.tension, string.bending, string.stretch / (2.0 * string.length), string.sigma0, string.sigma1]
    )
    contact = np.array([pressed.k1, pressed.k2, pressed.beta])
    bows = np.array([(2.0 * np.pi * e.centre, e.quality, e.gain, e.max_force) for e in ebows]).reshape(-1, 4)
    recorded = np.zeros((3 + len(ebows) + 2 * len(probes), samples))
    reached = _march(
        u,
        v,
        mu,
        law,
        contact,
        surface,
        surface_velocity,
        bows,
        weights,
        spans,
        spacing,
        step,
        oversampling,
        recorded,
    )
    if reached < t.size:
        raise ValueError(f"unstable at {reached * step:.6g} s: take fewer segments or more oversampling")
    bow_end, place_end = 3 + len(ebows), 3 + len(ebows) + len(probes)
    return GridMotion(
        time=t[::oversampling],
        pickups=recorded[:2],
        displacement=recorded[bow_end:place_end],
        velocity=recorded[place_end:],
        touch_force=recorded[2],
        drive_forces=recorded[3:bow_end],
        shape=u[1:-1].copy(),
    )


def _weights(place: Place, spacing: float, segments: int) -> Floats:
    """Return the share of each node in what happens at a place: none at the ends."""
    points, shares = (np.array([place]), np.ones(1)) if isinstance(place, float | int) else place
    row = np.zeros(segments + 3)
    for point, share in zip(points, shares, strict=True):
        node = min(int(point / spacing + 1e-9), segments - 1)
        beyond = point / spacing - node
        row[node + 1] += share * (1.0 - beyond)
        row[node + 2] += share * beyond
    row[[0, 1, -2, -1]] = 0.0
    row[abs(row) < 1e-12] = 0.0
    return row


@njit
def _march(
    u: Floats,
    v: Floats,
    mu: float,
    law: Floats,
    contact: Floats,
    surface: Floats,
    surface_velocity: Floats,
    bows: Floats,
    weights: Floats,
    spans: Indices,
    h: float,
    dt: float,
    stride: int,
    recorded: Floats,
) -> int:
    """March `u` and `v` over all steps and fill `recorded`; return how many steps were stable."""
    tension, sigma0 = law[0], law[3]
    count = bows.shape[0]
    a, after = np.zeros_like(u), np.zeros_like(u)
    y, z, force = np.zeros(count), np.zeros(count), np.zeros(count)
    self_weight = _gather(weights[0], spans[0], weights[0])
    for n in range(surface.size):
        kick = dt if n else 0.5 * dt  # the first kick leads from 0 to half a step
        stiff = _acceleration(u, v, mu, law, h, dt, a)
        for k in range(count):
            if n:
                sensed = _gather(weights[1 + k], spans[1 + k], v)
                y[k], z[k] = _filter(bows[k, 0], bows[k, 1], sensed, y[k], z[k], dt)
            force[k] = bows[k, 3] * np.tanh(bows[k, 2] * y[k] / bows[k, 3])
            _spread(weights[1 + count + k], spans[1 + count + k], force[k] / (mu * h), a)
        for j in range(2, u.size - 2):
            after[j] = ((1.0 - sigma0 * kick) * v[j] + kick * a[j]) / (1.0 + sigma0 * kick)

        way = kick / (mu * h * (1.0 + sigma0 * kick))  # what a newton on one node gives it in m/s
        compression = surface[n] - _gather(weights[0], spans[0], u)
        untouched = 0.5 * (_gather(weights[0], spans[0], v) + _gather(weights[0], spans[0], after))
        press = _press(contact, compression, surface_velocity[n] - untouched, 0.5 * way * self_weight)
        _spread(weights[0], spans[0], way * press, after)
        hardness = contact[0] + 1.5 * contact[1] * np.sqrt(max(compression, 0.0))
        if not stiff + hardness * self_weight * dt**2 / (4.0 * mu * h) <= 1.0:
            return n

        if n % stride == 0:
            now = n // stride
            recorded[0, now] = tension * (8.0 * u[2] - u[3]) / (6.0 * h)  # of order 4, since u and u_xx are 0
            recorded[1, now] = tension * (8.0 * u[-3] - u[-4]) / (6.0 * h)
            recorded[2, now] = press
            for k in range(count):
                recorded[3 + k, now] = force[k]
            probes = weights.shape[0] - 1 - 2 * count
            for p in range(probes):
                row, span = weights[1 + 2 * count + p], spans[1 + 2 * count + p]
                recorded[3 + count + p, now] = _gather(row, span, u)
                before = _gather(row, span, v)
                half = 0.5 * (before + _gather(row, span, after))
                recorded[3 + count + probes + p, now] = half if n else before
        for j in range(2, u.size - 2):
            v[j] = after[j]
            u[j] += dt * v[j]
    return surface.size


@njit
def _acceleration(u: Floats, v: Floats, mu: float, law: Floats, h: float, dt: float, a: Floats) -> float:
    """Fill in the string's acceleration but for sigma0; return its stiffness, of which the step bears 1."""
    u[0], u[-1] = -u[2], -u[-3]  # hinged: u and u_xx are zero at the ends
    v[0], v[-1] = -v[2], -v[-3]
    slope = 0.0
    for j in range(1, u.size - 2):
        slope += (u[j + 1] - u[j]) ** 2
    wave = (law[0] + law[2] * slope / h) / (mu * h**2)
    bend = law[1] / (mu * h**4)
    loss = 2.0 * law[4] / h**2
    for j in range(2, u.size - 2):
        curve = u[j - 1] - 2.0 * u[j] + u[j + 1]
        fourth = u[j - 2] + u[j + 2] - 4.0 * (u[j - 1] + u[j + 1]) + 6.0 * u[j]
        a[j] = wave * curve - bend * fourth + loss * (v[j - 1] - 2.0 * v[j] + v[j + 1])
    return (wave + 4.0 * bend) * dt**2 + 2.0 * loss * dt


@njit
def _press(contact: Floats, compression: float, approach: float, give: float) -> float:
    """Return the touch's force, where each newton takes `give` from the speed of approach."""
    if compression <= 0.0:
        return 0.0
    elastic = contact[0] * compression + contact[1] * compression**1.5
    return max(0.0, elastic * (1.0 + contact[2] * approach) / (1.0 + contact[2] * elastic * give))


@njit
def _filter(w0: float, quality: float, sensed: float, y: float, z: float, dt: float) -> tuple[float, float]:
    """Take y' = (w0 / Q) (s - y) - w0^2 z, z' = y one step on by the midpoint rule."""
    width, half = w0 / quality, 0.5 * dt
    # y+ = y + dt (width (s - (y + y+) / 2) - w0^2 (z + z+) / 2) with z+ = z + dt (y + y+) / 2
    given = y * (1.0 - half * width - (half * w0) ** 2) + dt * (width * sensed - w0**2 * z)
    new = given / (1.0 + half * width + (half * w0) ** 2)
    return new, z + half * (y + new)


@njit
def _gather(row: Floats, span: Indices, field: Floats) -> float:
    total = 0.0
    for j in range(span[0], span[1]):
        total += row[j] * field[j]
    return total


@njit
def _spread(row: Floats, span: Indices, amount: float, field: Floats) -> None:
    for j in range(span[0], span[1]):
        field[j] += row[j] * amount
