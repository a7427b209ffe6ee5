"""The normal force of a touch: a Hunt-Crossley contact in series with the modes that were left out.

The object's surface presses the string; where the compression delta is positive, f = k1 delta + k2
delta^3/2, times 1 + beta ddelta/dt (Hunt and Crossley 1975), and never below nothing. Modes beyond the bank
follow a slow force without delay: they are a spring of compliance R in series, so that the approach of
surface and modal string is eta = delta + R f.

Over one sample the elastic force is the rise of stored energy over the rise of eta. With the string carried
exactly under a held force, no energy then comes or goes by the stepping (the discrete gradient of Gonzalez
1996, as for collisions in Bilbao, Torin and Chatziioannou 2015), and every step has one solution, however
stiff. All is written in s = sqrt(delta), in which force, energy and eta are polynomials.
"""

import numpy as np

from monochord.physics.twin.part import called, part

NEWTON = 60
"""Most rounds of the safeguarded Newton iteration; three or four are usual."""
QUICK = 6
"""Most rounds of the plain Newton iteration; two or three are usual."""
EXACT = 1e-14
"""Relative step of s after which the search for a static press ends."""
CLOSE, NEAR = 1e-5, 1e-3
"""Relative step of s after which the iteration ends, and the plain one; what is left is of its square. The
plain one takes its second turn at the same sample when the string's stretch is known, and starts there from
its first."""


@part
def force_at(s: float, k1: float, k2: float) -> float:
    """Return the elastic force in N at compression s^2."""
    return s * s * (k1 + k2 * s)


@part
def stiffness_at(s: float, k1: float, k2: float) -> float:
    """Return the rise of the elastic force a metre of compression, in N/m."""
    return k1 + 1.5 * k2 * s


@part
def energy_at(s: float, k1: float, k2: float, rest: float) -> float:
    """Return the energy in J stored in the contact and in the modes left out."""
    force = force_at(s, k1, k2)
    return s**4 * (0.5 * k1 + 0.4 * k2 * s) + 0.5 * rest * force * force


@part
def approach_at(s: float, k1: float, k2: float, rest: float) -> float:
    """Return eta in m at compression s^2."""
    return s * s + rest * force_at(s, k1, k2)


@called
def root_of_compression(force: float, k1: float, k2: float) -> float:
    """Return s where the elastic force has a given value: the static press."""
    if force <= 0.0:
        return 0.0
    s = (force / k2) ** (1.0 / 3.0) if k2 > 0.0 else np.sqrt(force / k1)
    for _ in range(NEWTON):
        change = (force_at(s, k1, k2) - force) / (s * (2.0 * k1 + 3.0 * k2 * s))
        s -= change
        if abs(change) <= EXACT * s:
            break
    return s


@called
def _give(
    s: float, s_old: float, eta_old: float, k1: float, k2: float, rest: float, loss: float
) -> tuple[float, float, float, float]:
    """Return the mean force over a sample that ends at s, its slope, and eta and its slope there."""
    f, f_old = force_at(s, k1, k2), force_at(s_old, k1, k2)
    f_slope = s * (2.0 * k1 + 3.0 * k2 * s)
    eta = s * s + rest * f
    eta_slope = 2.0 * s + rest * f_slope
    if eta_old < 0.0:
        way = eta - eta_old
        force = energy_at(s, k1, k2, rest) / way
        slope = eta_slope * (f - force) / way
    else:
        secant = k1 * (s + s_old) + k2 * (s * s + s * s_old + s_old * s_old)
        secant_slope = k1 + k2 * (2.0 * s + s_old)
        way = s + s_old + rest * secant
        rise = (
            0.5 * k1 * (s + s_old) * (s * s + s_old * s_old)
            + 0.4 * k2 * (s**4 + s**3 * s_old + s * s * s_old * s_old + s * s_old**3 + s_old**4)
            + 0.5 * rest * (f + f_old) * secant
        )
        rise_slope = (
            0.5 * k1 * (3.0 * s * s + 2.0 * s * s_old + s_old * s_old)
            + 0.4 * k2 * (4.0 * s**3 + 3.0 * s * s * s_old + 2.0 * s * s_old * s_old + s_old**3)
            + 0.5 * rest * (f_slope * secant + (f + f_old) * secant_slope)
        )
        force = rise / way
        slope = (rise_slope - force * (1.0 + rest * secant_slope)) / way
    squeezed = s * s - s_old * s_old
    force += 0.5 * loss * (f + f_old) * squeezed
    slope += 0.5 * loss * (f_slope * squeezed + (f + f_old) * 2.0 * s)
    if force < 0.0:
        return 0.0, 0.0, eta, eta_slope
    return force, slope, eta, eta_slope


@part
def _quickly(
    gap: float,
    ease: float,
    s: float,
    s_old: float,
    k1: float,
    k2: float,
    rest: float,
    loss: float,
) -> tuple[float, float]:
    """Solve a touch that goes on by Newton's iteration alone; s is 0 if that fails.

    The equation is multiplied by (eta - eta_old) / (s - s_old), which leaves polynomials, and one division
    a round.
    """
    f_old = force_at(s_old, k1, k2)
    square = s_old * s_old
    for _ in range(QUICK):
        f, f_slope = s * s * (k1 + k2 * s), s * (2.0 * k1 + 3.0 * k2 * s)
        eta, eta_slope = s * s + rest * f, 2.0 * s + rest * f_slope
        secant = k1 * (s + s_old) + k2 * (s * s + s * s_old + square)
        secant_slope = k1 + k2 * (2.0 * s + s_old)
        way, way_slope = s + s_old + rest * secant, 1.0 + rest * secant_slope
        rise = (
            0.5 * k1 * (s + s_old) * (s * s + square)
            + 0.4 * k2 * (s * s * (s * (s + s_old) + square) + square * s_old * (s + s_old))
            + 0.5 * rest * (f + f_old) * secant
        )
        rise_slope = (
            0.5 * k1 * (3.0 * s * s + 2.0 * s * s_old + square)
            + 0.4 * k2 * (s * (4.0 * s * s + s_old * (3.0 * s + 2.0 * s_old)) + square * s_old)
            + 0.5 * rest * (f_slope * secant + (f + f_old) * secant_slope)
        )
        damped = 0.5 * loss * (s * s - square)
        damped_slope = loss * s
        rise += damped * (f + f_old) * way
        rise_slope += (damped_slope * (f + f_old) + damped * f_slope) * way + damped * (f + f_old) * way_slope
        miss = (eta - gap) * way + ease * rise
        change = miss / (eta_slope * way + (eta - gap) * way_slope + ease * rise_slope)
        s -= change
        if abs(change) <= NEAR * s:
            return s, approach_at(s, k1, k2, rest)
    return 0.0, 0.0


@part
def guess(gap: float, ease: float, s_old: float, eta_old: float, k1: float, k2: float) -> float:
    """Return about the s that solves a sample of a touch; the arguments are those of `press`.

    The string gives way far more in a sample than the contact does, so the mean force is close to what
    takes the whole gap but the old eta; a contact that goes on takes it as the mean of old and new (its
    cube root by one step of Halley's), a fresh one stores it.
    """
    if s_old > 0.0:
        force = 2.0 * (gap - eta_old) / ease - force_at(s_old, k1, k2)
        if force <= 0.0:
            return 0.3 * s_old
        cube, asked = s_old**3, force / (k2 + k1 / s_old)
        return s_old * (cube + 2.0 * asked) / (2.0 * cube + asked)
    if gap <= 0.0:
        return 0.0
    hard = gap / (0.4 * ease * (k2 + k1 / np.sqrt(gap)))
    return max(np.cbrt(hard), (hard * -eta_old) ** 0.2)


@called
def _carefully(
    gap: float,
    ease: float,
    start: float,
    s_old: float,
    eta_old: float,
    k1: float,
    k2: float,
    rest: float,
    loss: float,
) -> tuple[float, float, float]:
    """Solve a touch that comes, goes or goes on, by Newton's iteration between two bounds; see `press`."""
    stored = energy_at(s_old, k1, k2, rest)
    leaves = gap <= 0.0
    if not leaves and s_old > 0.0:
        force, _, _, _ = _give(0.0, s_old, eta_old, k1, k2, rest, loss)
        leaves = ease * force >= gap
    if leaves:
        far = eta_old - gap
        eta = 0.5 * (eta_old + gap - np.sqrt(far * far + 4.0 * ease * stored))
        return 0.0, eta, stored / (eta_old - eta)
    low, high = 0.0, np.sqrt(gap)
    s = min(start, high) if start > 0.0 else high
    force, eta = 0.0, 0.0
    for _ in range(NEWTON):
        force, slope, eta, eta_slope = _give(s, s_old, eta_old, k1, k2, rest, loss)
        miss = eta + ease * force - gap
        if miss > 0.0:
            high = s
        else:
            low = s
        new = s - miss / (eta_slope + ease * slope)
        if not low <= new <= high:
            new = 0.5 * (low + high)
        change = new - s
        s = new
        force += slope * change
        eta += eta_slope * change
        if abs(change) <= CLOSE * s:
            break
    return s, eta, max(force, 0.0)


@part
def press(
    gap: float,
    ease: float,
    start: float,
    s_old: float,
    eta_old: float,
    k1: float,
    k2: float,
    rest: float,
    loss: float,
) -> tuple[float, float, float]:
    """Solve one sample of a touch: eta + ease force(eta) = gap.

    Parameters
    ----------
    gap
        eta after the sample if nothing pressed, in m.
    ease
        What a newton held over the sample takes off it, in m/N.
    start
        A guess of s after the sample.
    s_old, eta_old
        sqrt(delta) in sqrt(m), zero out of contact, and eta in m before the sample.
    k1, k2
        Stiffness in N/m and N/m^1.5.
    rest
        Compliance of the modes left out, R in m/N.
    loss
        Hunt-Crossley's beta over the time step, in 1/m.

    Returns
    -------
    tuple
        s and eta after the sample, and the force held over it in N.
    """
    if gap <= 0.0 and s_old == 0.0:
        return 0.0, gap, 0.0
    if gap > 0.0 and s_old > 0.0 and start > 0.0:
        s, eta = _quickly(gap, ease, start, s_old, k1, k2, rest, loss)
        force = (gap - eta) / ease
        if s > 0.0 and force >= 0.0:
            return s, eta, force
    return _carefully(gap, ease, start, s_old, eta_old, k1, k2, rest, loss)
