"""The normal force of a touch: a Hunt-Crossley contact in series with the modes beyond the bank.

The object's surface presses the string; where the compression delta is positive, f = k1 delta + k2
delta^(3/2), times 1 + beta ddelta/dt (Hunt and Crossley 1975), and never negative. Modes beyond the bank
follow a slow force without delay: they are a spring of residual compliance R in series, so that the approach
of surface and modal string is eta = delta + R f.

Over one step the elastic force is the rise of stored energy over the rise of eta. As the string is propagated
exactly under a held force, the stepping then neither adds nor removes energy (the discrete gradient of
Gonzalez 1996, as for collisions in Bilbao, Torin and Chatziioannou 2015), and every step has one solution,
however stiff. All is written in s = sqrt(delta), in which force, energy and eta are polynomials.
"""

import numpy as np

from monochord.physics.twin.jit import called, inlined

MAX_NEWTON = 60
"""Iterations of the bracketed Newton method; three or four are usual."""
MAX_PLAIN_NEWTON = 6
"""Iterations of the plain Newton method; two or three are usual."""
STATIC_TOLERANCE = 1e-14
"""Relative step of s at which the iteration for a static press ends."""
BRACKETED_TOLERANCE, PLAIN_TOLERANCE = 1e-5, 1e-3
"""Relative step of s at which the bracketed and the plain iteration end; the error that remains is of its
square. The plain one runs again in the same step once the string's stretch is known, and starts from its
first result."""


@inlined
def elastic_force(s: float, k1: float, k2: float) -> float:
    """Return the elastic force in N at compression s^2."""
    return s * s * (k1 + k2 * s)


@inlined
def stiffness(s: float, k1: float, k2: float) -> float:
    """Return the slope of the elastic force by compression, in N/m."""
    return k1 + 1.5 * k2 * s


@inlined
def stored_energy(s: float, k1: float, k2: float, residual: float) -> float:
    """Return the energy in J stored in the contact and in the modes beyond the bank."""
    force = elastic_force(s, k1, k2)
    return s**4 * (0.5 * k1 + 0.4 * k2 * s) + 0.5 * residual * force * force


@inlined
def approach(s: float, k1: float, k2: float, residual: float) -> float:
    """Return eta in m at compression s^2."""
    return s * s + residual * elastic_force(s, k1, k2)


@called
def static_root(force: float, k1: float, k2: float) -> float:
    """Return s of a static press: where the elastic force has a given value in N."""
    if force <= 0.0:
        return 0.0
    s = (force / k2) ** (1.0 / 3.0) if k2 > 0.0 else np.sqrt(force / k1)
    for _ in range(MAX_NEWTON):
        change = (elastic_force(s, k1, k2) - force) / (s * (2.0 * k1 + 3.0 * k2 * s))
        s -= change
        if abs(change) <= STATIC_TOLERANCE * s:
            break
    return s


@called
def _mean_force(
    s: float, s_old: float, eta_old: float, k1: float, k2: float, residual: float, beta: float
) -> tuple[float, float, float, float]:
    """Return the mean force over a step that ends at s, its slope, and eta and its slope there."""
    f, f_old = elastic_force(s, k1, k2), elastic_force(s_old, k1, k2)
    f_slope = s * (2.0 * k1 + 3.0 * k2 * s)
    eta = s * s + residual * f
    eta_slope = 2.0 * s + residual * f_slope
    if eta_old < 0.0:
        travel = eta - eta_old
        force = stored_energy(s, k1, k2, residual) / travel
        slope = eta_slope * (f - force) / travel
    else:
        secant = k1 * (s + s_old) + k2 * (s * s + s * s_old + s_old * s_old)
        secant_slope = k1 + k2 * (2.0 * s + s_old)
        travel = s + s_old + residual * secant
        rise = (
            0.5 * k1 * (s + s_old) * (s * s + s_old * s_old)
            + 0.4 * k2 * (s**4 + s**3 * s_old + s * s * s_old * s_old + s * s_old**3 + s_old**4)
            + 0.5 * residual * (f + f_old) * secant
        )
        rise_slope = (
            0.5 * k1 * (3.0 * s * s + 2.0 * s * s_old + s_old * s_old)
            + 0.4 * k2 * (4.0 * s**3 + 3.0 * s * s * s_old + 2.0 * s * s_old * s_old + s_old**3)
            + 0.5 * residual * (f_slope * secant + (f + f_old) * secant_slope)
        )
        force = rise / travel
        slope = (rise_slope - force * (1.0 + residual * secant_slope)) / travel
    squeezed = s * s - s_old * s_old
    force += 0.5 * beta * (f + f_old) * squeezed
    slope += 0.5 * beta * (f_slope * squeezed + (f + f_old) * 2.0 * s)
    if force < 0.0:
        return 0.0, 0.0, eta, eta_slope
    return force, slope, eta, eta_slope


@inlined
def _solve_plain(
    gap: float,
    compliance: float,
    s: float,
    s_old: float,
    k1: float,
    k2: float,
    residual: float,
    beta: float,
) -> tuple[float, float]:
    """Solve a contact that continues by Newton's method alone; s is 0 if that fails.

    The equation is multiplied by (eta - eta_old) / (s - s_old), which leaves polynomials, and one division an
    iteration.
    """
    f_old = elastic_force(s_old, k1, k2)
    square = s_old * s_old
    for _ in range(MAX_PLAIN_NEWTON):
        f, f_slope = s * s * (k1 + k2 * s), s * (2.0 * k1 + 3.0 * k2 * s)
        eta, eta_slope = s * s + residual * f, 2.0 * s + residual * f_slope
        secant = k1 * (s + s_old) + k2 * (s * s + s * s_old + square)
        secant_slope = k1 + k2 * (2.0 * s + s_old)
        travel, travel_slope = s + s_old + residual * secant, 1.0 + residual * secant_slope
        rise = (
            0.5 * k1 * (s + s_old) * (s * s + square)
            + 0.4 * k2 * (s * s * (s * (s + s_old) + square) + square * s_old * (s + s_old))
            + 0.5 * residual * (f + f_old) * secant
        )
        rise_slope = (
            0.5 * k1 * (3.0 * s * s + 2.0 * s * s_old + square)
            + 0.4 * k2 * (s * (4.0 * s * s + s_old * (3.0 * s + 2.0 * s_old)) + square * s_old)
            + 0.5 * residual * (f_slope * secant + (f + f_old) * secant_slope)
        )
        damped = 0.5 * beta * (s * s - square)
        damped_slope = beta * s
        rise += damped * (f + f_old) * travel
        rise_slope += (damped_slope * (f + f_old) + damped * f_slope) * travel + damped * (
            f + f_old
        ) * travel_slope
        error = (eta - gap) * travel + compliance * rise
        change = error / (eta_slope * travel + (eta - gap) * travel_slope + compliance * rise_slope)
        s -= change
        if abs(change) <= PLAIN_TOLERANCE * s:
            return s, approach(s, k1, k2, residual)
    return 0.0, 0.0


@inlined
def initial_guess(gap: float, compliance: float, s_old: float, eta_old: float, k1: float, k2: float) -> float:
    """Return an estimate of the s that solves a step; the arguments are those of `solve`.

    Over a step the string yields far more than the contact does, so the mean force is close to what moves the
    string by the whole gap less the old eta. In a contact that continues it is the mean of old and new force
    (its cube root by one step of Halley's method); in a new one it goes into stored energy.
    """
    if s_old > 0.0:
        force = 2.0 * (gap - eta_old) / compliance - elastic_force(s_old, k1, k2)
        if force <= 0.0:
            return 0.3 * s_old
        cube, target = s_old**3, force / (k2 + k1 / s_old)
        return s_old * (cube + 2.0 * target) / (2.0 * cube + target)
    if gap <= 0.0:
        return 0.0
    initial = gap / (0.4 * compliance * (k2 + k1 / np.sqrt(gap)))
    return max(np.cbrt(initial), (initial * -eta_old) ** 0.2)


@called
def _solve_bracketed(
    gap: float,
    compliance: float,
    start: float,
    s_old: float,
    eta_old: float,
    k1: float,
    k2: float,
    residual: float,
    beta: float,
) -> tuple[float, float, float]:
    """Solve a contact that begins, ends or continues, by Newton's method in a bracket; see `solve`."""
    stored = stored_energy(s_old, k1, k2, residual)
    ends = gap <= 0.0
    if not ends and s_old > 0.0:
        force, _, _, _ = _mean_force(0.0, s_old, eta_old, k1, k2, residual, beta)
        ends = compliance * force >= gap
    if ends:
        far = eta_old - gap
        eta = 0.5 * (eta_old + gap - np.sqrt(far * far + 4.0 * compliance * stored))
        return 0.0, eta, stored / (eta_old - eta)
    low, high = 0.0, np.sqrt(gap)
    s = min(start, high) if start > 0.0 else high
    force, eta = 0.0, 0.0
    for _ in range(MAX_NEWTON):
        force, slope, eta, eta_slope = _mean_force(s, s_old, eta_old, k1, k2, residual, beta)
        error = eta + compliance * force - gap
        if error > 0.0:
            high = s
        else:
            low = s
        new = s - error / (eta_slope + compliance * slope)
        if not low <= new <= high:
            new = 0.5 * (low + high)
        change = new - s
        s = new
        force += slope * change
        eta += eta_slope * change
        if abs(change) <= BRACKETED_TOLERANCE * s:
            break
    return s, eta, max(force, 0.0)


@inlined
def solve(
    gap: float,
    compliance: float,
    start: float,
    s_old: float,
    eta_old: float,
    k1: float,
    k2: float,
    residual: float,
    beta: float,
) -> tuple[float, float, float]:
    """Solve one step of a contact: eta + compliance force(eta) = gap.

    Parameters
    ----------
    gap
        eta after the step without a force, in m.
    compliance
        Of the modal string over a step: what a newton held over it takes off eta, in m/N.
    start
        An estimate of s after the step.
    s_old, eta_old
        sqrt(delta) in sqrt(m), zero out of contact, and eta in m before the step.
    k1, k2
        Stiffness in N/m and N/m^1.5.
    residual
        Compliance of the modes beyond the bank, R in m/N.
    beta
        Hunt-Crossley's beta over the time step, in 1/m.

    Returns
    -------
    tuple
        s and eta after the step, and the force held over it in N.
    """
    if gap <= 0.0 and s_old == 0.0:
        return 0.0, gap, 0.0
    if gap > 0.0 and s_old > 0.0 and start > 0.0:
        s, eta = _solve_plain(gap, compliance, start, s_old, k1, k2, residual, beta)
        force = (gap - eta) / compliance
        if s > 0.0 and force >= 0.0:
            return s, eta, force
    return _solve_bracketed(gap, compliance, start, s_old, eta_old, k1, k2, residual, beta)
