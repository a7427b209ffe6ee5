"""How many steps a frame takes, how many modes it holds, and how strongly a touch holds them.

A touch held over a sample sees each mode through the stepping: with theta = omega dt its compliance is

    g sum_n phi_n^2 / (m omega_n^2) a_n^2 / (a_n^2 - tan^2(theta/2)) + R,   a_n = tan(omega_n dt / 2),

where the string's own is the same sum without end over phi_n^2 / (m (omega_n^2 - omega^2)). Both are known
in closed form, so the frequencies of a clamped string, where the compliance is nil, can be compared before
anything is simulated. The weight of mode n is g_n = (Omega_n / sin Omega_n)^beta: beta 1 gives each mode
its exact residue, beta 0 the exact static compliance, and near 0.45 their errors cancel at the frequencies
of segments. beta is fitted to the string, then the fewest steps a frame that meet the tolerance are taken.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats, StringParams
from monochord.core.units import Hertz
from monochord.physics.theory import bending_stiffness, static_compliance

CHOICES = (1, 2, 4, 8)
HALVES = (16, 32, 48, 96, 256)
"""Modes that half of a bank may have room for; each size is a kernel of its own."""
TOPS = (0.36, 0.375, 0.39, 0.405, 0.42)
"""Highest mode as a share of the stepping rate: some 17 kHz at 44.1 kHz."""
PLACES = np.linspace(0.21, 0.79, 9)
BETAS = np.linspace(0.34, 0.54, 21)
BEYOND = 6
"""How many times the modes of a bank stand for the string itself; the rest of its compliance is static."""
BISECTIONS = 44


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """`finer` steps a frame, `count` modes a polarisation, exponent `beta`, and the `error` in cents."""

    finer: int
    count: int
    beta: float
    error: float


@lru_cache(maxsize=256)
def plan(
    string: StringParams, rate: Hertz, *, tolerance: float = 0.05, partials: int = 4, finer: int | None = None
) -> Plan:
    """Return the cheapest plan that holds the lowest partials of a clamped string to a tolerance.

    Parameters
    ----------
    string
        The string.
    rate
        Frames a second.
    tolerance
        Largest error in cents, over touches between a fifth and four fifths of the string.
    partials
        How many partials of the clamped string, from the lowest.
    finer
        Steps a frame, if they are to be given; the tolerance then has no say.

    Returns
    -------
    Plan
        The best of the allowed ones, if none meets the tolerance.

    Examples
    --------
    >>> guitar = StringParams(length=0.65, linear_density=4.0e-4, tension=73.0, core_diameter=2.54e-4)
    >>> plan(guitar, 44100.0).finer
    1
    """
    if finer is not None and finer not in (*CHOICES, 16, 32):
        raise InputError(f"{finer} steps a frame", "1, 2, 4, 8, 16 or 32")
    found: list[Plan] = []
    for steps in CHOICES if finer is None else (finer,):
        found = [_best(string, rate, steps, partials, top) for top in TOPS]
        good = [one for one in found if one.error <= tolerance]
        if good:
            least = min(padded(one.count) for one in good)
            found = [one for one in good if padded(one.count) == least]
            break
    best = min(found, key=lambda one: one.error)
    if best.count == 0:
        given = f"{string.length:g} m of string whose fourth mode is too fast for {rate:g} Hz"
        raise InputError(given, "2.3 steps a period at least", "raise the sample rate")
    return best


def mode_frequencies(string: StringParams, count: int) -> Floats:
    """Return the angular frequencies of the first modes of a stiff, hinged string, in rad/s."""
    k = np.arange(1, count + 1) * np.pi / string.length
    omega = k * np.sqrt((string.tension + bending_stiffness(string) * k * k) / string.linear_density)
    return np.asarray(omega, dtype=np.float64)


def mode_count(string: StringParams, stepping: Hertz, top: float) -> int:
    """Return how many modes lie below the highest at a share of the stepping rate, at least four."""
    most = int(2.0 * string.length * top * stepping / np.sqrt(string.tension / string.linear_density)) + 1
    return max(4, int(np.sum(mode_frequencies(string, most) <= 2.0 * np.pi * top * stepping)))


def padded(count: int) -> int:
    """Return the modes a half of the bank has room for.

    Examples
    --------
    >>> padded(16), padded(17)
    (16, 32)
    """
    for half in HALVES:
        if count <= half:
            return half
    raise InputError(f"{count} modes", f"{HALVES[-1]} at most", "lower the sample rate")


def touch_weights(omega: Floats, step: float, beta: float) -> Floats:
    """Return g_n = (Omega_n / sin Omega_n)^beta of each mode."""
    turn = omega * step
    return (turn / np.sin(turn)) ** beta


def _best(string: StringParams, rate: Hertz, finer: int, partials: int, top: float) -> Plan:
    step = 1.0 / (rate * finer)
    count = mode_count(string, 1.0 / step, top)
    omega = mode_frequencies(string, BEYOND * count)
    if omega[count - 1] * step > 0.9 * np.pi:
        return Plan(finer=finer, count=0, beta=0.0, error=np.inf)
    mass = 0.5 * string.linear_density * string.length
    at = PLACES * string.length
    shape = np.sin(np.outer(at, np.arange(1, omega.size + 1)) * np.pi / string.length) ** 2 / mass
    whole = static_compliance(string, at)
    partials = min(partials, count - 1)
    true = _zeros(shape, omega**2, whole - (shape / omega**2).sum(axis=1), partials, omega, lambda w: w * w)
    best = Plan(finer=finer, count=count, beta=0.0, error=np.inf)
    pole = np.tan(0.5 * omega[:count] * step) ** 2
    for beta in BETAS:
        static = shape[:, :count] * touch_weights(omega[:count], step, beta) / omega[:count] ** 2
        rest = whole - static.sum(axis=1)
        if (rest < 0.0).any():
            continue
        found = _zeros(static * pole, pole, rest, partials, omega, lambda w: np.tan(0.5 * w * step) ** 2)
        error = float(np.abs(1200.0 * np.log2(found / true)).max())
        if error < best.error:
            best = Plan(finer=finer, count=count, beta=float(beta), error=error)
    return best


def _zeros(residue: Floats, pole: Floats, rest: Floats, partials: int, omega: Floats, warp: object) -> Floats:
    """Return where, between poles, sum residue / (pole - warp(w)) + rest is nil."""
    low = np.tile(omega[:partials] * (1.0 + 1e-9), (residue.shape[0], 1))
    high = np.tile(omega[1 : partials + 1] * (1.0 - 1e-9), (residue.shape[0], 1))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        here = warp(middle)  # type: ignore[operator]
        value = (residue[:, None, :] / (pole - here[:, :, None])).sum(axis=2) + rest[:, None]
        low = np.where(value < 0.0, middle, low)
        high = np.where(value < 0.0, high, middle)
    return 0.5 * (low + high)
