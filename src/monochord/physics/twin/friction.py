"""Friction of a touch: a bristle that sticks, creeps and slides, and which of its motion counts as slip.

Object and string are joined by a bristle of deflection z and stiffness sigma (Dupont et al. 2002; Canudas de
Wit et al. 1995). Below a break-away deflection it is elastic (stick); beyond, part of the motion is lost
(creep); at mu(v) N / sigma all of it (slide), with Stribeck's mu(v) = mu_k + (mu_s - mu_k) exp(-(v / v_s)^2).
The bristle's own damping acts on dz/dt, so that steady sliding feels mu N and no more. The loss of z takes
the speed of the step before, which leaves one linear equation a step, and only dissipates: the bristle's
energy never grows by more than the work done on it.

Slip is read from the place of the contact on the object, p = object - string - z. It is constant while the
contact sticks, and oscillates while a ringing string rocks under the object or hops off it. Two poles remove
that oscillation, and a play (backlash) removes what then wanders by less than `SLIP_PLAY` to either side; the
speed of what remains is the sliding speed.
"""

import numpy as np

from monochord.physics.twin.jit import inlined

BREAKAWAY = 0.7
"""Share of the sliding deflection below which a bristle is elastic."""


@inlined
def friction_coefficient(speed: float, static: float, kinetic: float, stribeck: float) -> float:
    """Return the coefficient of steady friction at a sliding speed in m/s."""
    ratio = speed / stribeck
    return kinetic + (static - kinetic) * np.exp(-ratio * ratio) if ratio < 6.0 else kinetic


@inlined
def sliding_share(z: float, limit: float) -> float:
    """Return the share of motion that slides at a deflection: 0 sticks, 1 slides, a smooth step between."""
    size = abs(z)
    low = BREAKAWAY * limit
    if size <= low:
        return 0.0
    if size >= limit:
        return 1.0
    t = (size - low) / (limit - low)
    return t * t * (3.0 - 2.0 * t)


@inlined
def bristle(
    z: float, moved: float, compliance: float, stiffness: float, damping: float, fade: float
) -> tuple[float, float, float]:
    """Solve one step of a bristle: the force on the string, the relative motion, and the new deflection.

    `z` is the deflection before, and `moved` the motion of object against string without a force, in m; a
    newton held over the step takes `compliance` off it. `stiffness` and, over the time step, `damping` are in
    N/m; as much damping acts as `fade`, the share of z lost over the step, leaves passive.
    """
    if damping * fade > 4.0 * stiffness:
        damping = 4.0 * stiffness / fade
    total = (stiffness + damping) / (1.0 + fade)
    force = (total * (z + moved) - damping * z) / (1.0 + compliance * total)
    slid = moved - compliance * force
    return force, slid, (z + slid) / (1.0 + fade)


@inlined
def play(width: float, across: float, along: float, mark: float, mark_along: float) -> tuple[float, float]:
    """Return how far, in m both ways, a place at `across`, `along` drags a mark by a play of `width`.

    The mark, at `mark`, `mark_along`, follows once the place is farther off than `width`, and stays at that
    distance.
    """
    x, y = across - mark, along - mark_along
    distance = np.sqrt(x * x + y * y)
    if distance <= width:
        return 0.0, 0.0
    share = 1.0 - width / distance
    return share * x, share * y
