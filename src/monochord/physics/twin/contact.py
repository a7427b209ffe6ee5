"""The normal force of a touch: a Hunt-Crossley contact in series with the modes beyond the bank.

The object's surface presses the string; where the compression delta is positive, f = k1 delta + k2
delta^(3/2), times 1 + beta ddelta/dt (Hunt and Crossley 1975), and never negative. Modes beyond the bank
follow a slow force without delay: they are a spring of residual compliance R in series, so that the approach
of surface and modal string is eta = delta + R f.

Over one step the elastic force is the rise of stored energy over the rise of eta. As the string is propagated
exactly under a held force, the stepping then neither adds nor removes energy (the discrete gradient of
Gonzalez 1996, as for collisions in Bilbao, Torin and Chatziioannou 2015), and every step has one solution,
however stiff. All is written in s = sqrt(delta), in which force, energy and eta are polynomials.

A rough surface adds a layer in series, whose asperities close by u = u0 log(1 + f / F0): its stiffness grows
as (f + F0) / u0, with the load (Persson 2007). It stores u0 (f - F0 log(1 + f / F0)), so that the discrete
gradient holds with it too. A `layer` of None is left out where the function is compiled.
"""

import numpy as np

from monochord.physics.twin.jit import called, inlined
from monochord.physics.twin.records import LayerParameters

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
MAX_SERIES = 0.02
"""Below this x, log(1 + x) / x is taken from its series of seven terms, to 2e-13."""


@inlined
def elastic_force(s: float, k1: float, k2: float) -> float:
    """Return the elastic force in N at compression s^2."""
    return s * s * (k1 + k2 * s)


@inlined
def stiffness(s: float, k1: float, k2: float) -> float:
    """Return the slope of the elastic force by compression, in N/m."""
    return k1 + 1.5 * k2 * s


@inlined
def layer_closure(force: float, layer: LayerParameters) -> float:
    """Return by how much a rough layer closes under a force, u in m."""
    return layer.thickness * np.log(1.0 + force / layer.load)


@inlined
def layer_compliance(force: float, layer: LayerParameters) -> float:
    """Return du/df of a rough layer, in m/N."""
    return layer.thickness / (layer.load + force)


@inlined
def layer_energy(force: float, layer: LayerParameters) -> float:
    """Return the energy in J that a rough layer stores under a force."""
    return layer.thickness * (force - layer.load * np.log(1.0 + force / layer.load))


@inlined
def _log_share(x: float) -> tuple[float, float]:
    """Return log(1 + x) / x and its slope."""
    if abs(x) < MAX_SERIES:
        tail = 1.0 / 4.0 - x * (1.0 / 5.0 - x * (1.0 / 6.0 - x / 7.0))
        tail_slope = 3.0 / 4.0 - x * (4.0 / 5.0 - x * (5.0 / 6.0))
        return 1.0 - x * (0.5 - x * (1.0 / 3.0 - x * tail)), -0.5 + x * (2.0 / 3.0 - x * tail_slope)
    share = np.log(1.0 + x) / x
    return share, (1.0 / (1.0 + x) - share) / x


@inlined
def _layer_secants(
    f: float, f_old: float, f_slope: float, secant: float, secant_slope: float, layer: LayerParameters
) -> tuple[float, float, float, float]:
    """Return the mean slopes by s of a layer's closure and energy from the old force on, each with its own.

    `secant` is (f - f_old) / (s - s_old). Written by log(1 + x) / x, x = (f - f_old) / (F0 + f_old), they are
    free of cancellation.
    """
    whole = layer.load + f_old
    share, bend = _log_share((f - f_old) / whole)
    bend *= f_slope / whole
    u0, rest = layer.thickness, layer.load / whole
    closure, closure_slope = u0 / whole * secant * share, u0 / whole * (secant_slope * share + secant * bend)
    energy = u0 * secant * (1.0 - rest * share)
    energy_slope = u0 * (secant_slope * (1.0 - rest * share) - secant * rest * bend)
    return closure, closure_slope, energy, energy_slope


@inlined
def stored_energy(
    s: float, k1: float, k2: float, residual: float, layer: LayerParameters | None = None
) -> float:
    """Return the energy in J stored in the contact, its layer and the modes beyond the bank."""
    force = elastic_force(s, k1, k2)
    stored = s**4 * (0.5 * k1 + 0.4 * k2 * s) + 0.5 * residual * force * force
    if layer is not None:
        stored += layer_energy(force, layer)
    return stored


@inlined
def approach(s: float, k1: float, k2: float, residual: float, layer: LayerParameters | None = None) -> float:
    """Return eta in m at compression s^2."""
    eta = s * s + residual * elastic_force(s, k1, k2)
    if layer is not None:
        eta += layer_closure(elastic_force(s, k1, k2), layer)
    return eta


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
    s: float,
    s_old: float,
    eta_old: float,
    k1: float,
    k2: float,
    residual: float,
    beta: float,
    layer: LayerParameters | None,
) -> tuple[float, float, float, float]:
    """Return the mean force over a step that ends at s, its slope, and eta and its slope there."""
    f, f_old = elastic_force(s, k1, k2), elastic_force(s_old, k1, k2)
    f_slope = s * (2.0 * k1 + 3.0 * k2 * s)
    eta = s * s + residual * f
    eta_slope = 2.0 * s + residual * f_slope
    if layer is not None:
        eta += layer_closure(f, layer)
        eta_slope += layer.thickness * f_slope / (layer.load + f)
    if eta_old < 0.0:
        travel = eta - eta_old
        force = stored_energy(s, k1, k2, residual, layer) / travel
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
        travel_slope = 1.0 + residual * secant_slope
        if layer is not None:
            more, more_slope, energy, energy_slope = _layer_secants(
                f, f_old, f_slope, secant, secant_slope, layer
            )
            travel += more
            travel_slope += more_slope
            rise += energy
            rise_slope += energy_slope
        force = rise / travel
        slope = (rise_slope - force * travel_slope) / travel
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
    eta_old: float,
    k1: float,
    k2: float,
    residual: float,
    beta: float,
    layer: LayerParameters | None,
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
        if layer is not None:
            more, more_slope, energy, energy_slope = _layer_secants(
                f, f_old, f_slope, secant, secant_slope, layer
            )
            # The closure from the old one on, which eta_old holds: that saves a logarithm.
            eta += eta_old - square - residual * f_old + more * (s - s_old)
            eta_slope += layer.thickness * f_slope / (layer.load + f)
            travel += more
            travel_slope += more_slope
            rise += energy
            rise_slope += energy_slope
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
            return s, approach(s, k1, k2, residual, layer)
    return 0.0, 0.0


@inlined
def initial_guess(
    gap: float,
    compliance: float,
    s_old: float,
    eta_old: float,
    k1: float,
    k2: float,
    residual: float = 0.0,
    layer: LayerParameters | None = None,
) -> float:
    """Return an estimate of the s that solves a step; the arguments are those of `solve`.

    Over a step the string yields far more than the contact does, so the mean force is close to what moves the
    string by the whole gap less the old eta. In a contact that continues it is the mean of old and new force
    (its cube root by one step of Halley's method); in a new one it goes into stored energy. A rough layer
    yields more, so that beside one the contact's own compliance counts.
    """
    if s_old > 0.0:
        force = 2.0 * (gap - eta_old) / compliance - elastic_force(s_old, k1, k2)
        if layer is not None:
            old, half = elastic_force(s_old, k1, k2), 0.5 * compliance
            compliance_old = 1.0 / stiffness(s_old, k1, k2) + residual + layer_compliance(old, layer)
            force = (gap - eta_old + (compliance_old - half) * old) / (compliance_old + half)
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
    layer: LayerParameters | None,
) -> tuple[float, float, float]:
    """Solve a contact that begins, ends or continues, by Newton's method in a bracket; see `solve`."""
    stored = stored_energy(s_old, k1, k2, residual, layer)
    ends = gap <= 0.0
    if not ends and s_old > 0.0:
        force, _, _, _ = _mean_force(0.0, s_old, eta_old, k1, k2, residual, beta, layer)
        ends = compliance * force >= gap
    if ends:
        far = eta_old - gap
        eta = 0.5 * (eta_old + gap - np.sqrt(far * far + 4.0 * compliance * stored))
        return 0.0, eta, stored / (eta_old - eta)
    low, high = 0.0, np.sqrt(gap)
    s = min(start, high) if start > 0.0 else high
    force, eta = 0.0, 0.0
    for _ in range(MAX_NEWTON):
        force, slope, eta, eta_slope = _mean_force(s, s_old, eta_old, k1, k2, residual, beta, layer)
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
    layer: LayerParameters | None = None,
) -> tuple[float, float, float]:
    """Solve one step of a contact: eta + compliance force(eta) = gap. Return new s, eta and force.

    `gap` is eta after the step without a force, in m; `compliance` that of the modal string over a step, in
    m/N. `start` estimates the new s; `s_old` is sqrt(delta), zero out of contact. Stiffness `k1` is in N/m
    and `k2` in N/m^1.5, `residual` the compliance of the modes beyond the bank, `beta` Hunt-Crossley's over
    the time step.
    """
    if gap <= 0.0 and s_old == 0.0:
        return 0.0, gap, 0.0
    if gap > 0.0 and s_old > 0.0 and start > 0.0:
        s, eta = _solve_plain(gap, compliance, start, s_old, eta_old, k1, k2, residual, beta, layer)
        force = (gap - eta) / compliance
        if s > 0.0 and force >= 0.0:
            return s, eta, force
    return _solve_bracketed(gap, compliance, start, s_old, eta_old, k1, k2, residual, beta, layer)
