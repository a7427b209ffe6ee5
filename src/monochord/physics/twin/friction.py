"""Friction of a touch: a bristle that sticks, creeps and slides (Dupont et al. 2002; Canudas de Wit et al. 1995).

Object and string are joined by a bristle of deflection z and stiffness sigma. Below a break-away deflection it is
elastic (stick); beyond, part of the motion is lost (creep); at mu(v) N / sigma all of it (slide), with Stribeck's
mu(v) = mu_k + (mu_s - mu_k) exp(-(v / v_s)^2). The loss takes the speed of the sample before, which leaves one
linear equation a sample, and gives energy away only: the bristle's store never grows by more than the work done.
"""

import numpy as np

from monochord.physics.twin.part import part

NONE, STICK, CREEP, SLIDE = range(4)
BREAKAWAY = 0.7
"""Share of the sliding deflection below which a bristle is elastic."""


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
        Its damping over the time step, in N/m.
    fade
        Share of z lost over the sample.
    """
    held = stiffness / (1.0 + fade)
    force = (held * (z + moved) + loss * moved) / (1.0 + ease * (held + loss))
    left = moved - ease * force
    return force, left, (z + left) / (1.0 + fade)
