"""Friction of a touch: a bristle that sticks, creeps and slides, and what of its motion counts as slip.

Object and string are joined by a bristle of deflection z and stiffness sigma (Dupont et al. 2002; Canudas
de Wit et al. 1995). Below a break-away deflection it is elastic (stick); beyond, part of the motion is lost
(creep); at mu(v) N / sigma all of it (slide), with Stribeck's mu(v) = mu_k + (mu_s - mu_k) exp(-(v /
v_s)^2). The bristle's own damping acts on dz/dt, so that steady sliding feels mu N and no more. The loss
takes the speed of the sample before, which leaves one linear equation a sample, and gives energy away only:
the bristle's store never grows by more than the work done on it.

What counts as slip is read from the place of the contact on the object, p = object - string - z. It stays
put while the contact sticks, and goes to and fro while a ringing string rocks under the object or hops off
it. Two poles take that swing away, and a play leaves out what then wanders by less than `PLAY` to either
side; the speed of what is left is the sliding speed.
"""

import numpy as np

from monochord.physics.twin.part import part

NONE, STICK, CREEP, SLIDE = range(4)
BREAKAWAY = 0.7
"""Share of the sliding deflection below which a bristle is elastic."""
PLAY = 2.5e-5
"""How far in m a contact wanders to either side before it counts as moving on."""


@part
def grip(speed: float, static: float, kinetic: float, stribeck: float) -> float:
    """Return the coefficient of steady friction at a sliding speed in m/s."""
    ratio = speed / stribeck
    return kinetic + (static - kinetic) * np.exp(-ratio * ratio) if ratio < 6.0 else kinetic


@part
def creeping(z: float, most: float) -> float:
    """Return the share of motion that a deflection loses: 0 sticks, 1 slides, a smooth step between."""
    size = abs(z)
    low = BREAKAWAY * most
    if size <= low:
        return 0.0
    if size >= most:
        return 1.0
    t = (size - low) / (most - low)
    return t * t * (3.0 - 2.0 * t)


@part
def bristle(
    z: float, moved: float, ease: float, stiffness: float, loss: float, fade: float
) -> tuple[float, float, float]:
    """Solve one sample of a bristle: the force on the string, the relative motion left, and the deflection.

    Parameters
    ----------
    z
        Deflection before the sample in m.
    moved
        Motion of the object relative to the string over the sample if no force acted, in m.
    ease
        What a newton held over the sample takes off it, in m/N.
    stiffness
        Of the bristle, in N/m.
    loss
        Its damping over the time step, in N/m; as much of it acts as the loss of z leaves passive.
    fade
        Share of z lost over the sample.
    """
    if loss * fade > 4.0 * stiffness:
        loss = 4.0 * stiffness / fade
    held = (stiffness + loss) / (1.0 + fade)
    force = (held * (z + moved) - loss * z) / (1.0 + ease * held)
    left = moved - ease * force
    return force, left, (z + left) / (1.0 + fade)


@part
def played(width: float, across: float, along: float, rest: float, rest_along: float) -> tuple[float, float]:
    """Return how far, in m both ways, a place at `across`, `along` pulls a mark that has a play of `width`.

    The mark, at `rest`, `rest_along`, follows once the place is farther off than `width`, and keeps at that.
    """
    far, aside = across - rest, along - rest_along
    gone = np.sqrt(far * far + aside * aside)
    if gone <= width:
        return 0.0, 0.0
    share = 1.0 - width / gone
    return share * far, share * aside
