"""The rate plan of a string: steps a frame, modes in the bank, and the weight of each mode at a touch.

A touch whose force is held over a step sees each mode through the stepping: with theta = omega dt its
compliance is

    g sum_n phi_n^2 / (m omega_n^2) a_n^2 / (a_n^2 - tan^2(theta/2)) + R,   a_n = tan(omega_n dt / 2),

where the string's own is the infinite sum over phi_n^2 / (m (omega_n^2 - omega^2)). Both are known
in closed form, so the frequencies of a clamped string, where the compliance is zero, can be compared before
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

OVERSAMPLINGS = (1, 2, 4, 8)
HALF_SIZES = (16, 32, 48, 96, 256)
"""Modes that half of a bank has room for; each size is compiled to a kernel of its own."""
TOP_FREQUENCIES = (0.36, 0.375, 0.39, 0.405, 0.42)
"""Highest mode as a share of the stepping rate: some 17 kHz at 44.1 kHz."""
TOUCH_POSITIONS = np.linspace(0.21, 0.79, 9)
BETAS = np.linspace(0.34, 0.54, 21)
EXACT_MODES = 6
"""Modes of the exact string, as a multiple of the bank's; the rest of its compliance is static."""
MAX_BISECTIONS = 44


@dataclass(frozen=True, slots=True, kw_only=True)
class RatePlan:
    """Steps a frame, `count` of modes a polarisation, exponent `beta`, and the `error` in cents."""

    oversampling: int
    count: int
    beta: float
    error: float


@lru_cache(maxsize=256)
def plan(
    string: StringParams,
    rate: Hertz,
    *,
    tolerance: float = 0.05,
    partials: int = 4,
    oversampling: int | None = None,
) -> RatePlan:
    """Return the cheapest plan that keeps the lowest `partials` of a clamped string within a `tolerance`.

    That is the largest error in cents, over touches between a fifth and four fifths of the string; if none
    meets it, the plan is the most exact one. Prescribed steps a frame, `oversampling`, ignore it.

    >>> guitar = StringParams(length=0.65, linear_density=4.0e-4, tension=73.0, core_diameter=2.54e-4)
    >>> plan(guitar, 44100.0).oversampling
    1
    """
    if oversampling is not None and oversampling not in (*OVERSAMPLINGS, 16, 32):
        raise InputError(f"{oversampling} steps a frame", "1, 2, 4, 8, 16 or 32")
    plans: list[RatePlan] = []
    for steps in OVERSAMPLINGS if oversampling is None else (oversampling,):
        plans = [_best(string, rate, steps, partials, top) for top in TOP_FREQUENCIES]
        good = [one for one in plans if one.error <= tolerance]
        if good:
            least = min(padded(one.count) for one in good)
            plans = [one for one in good if padded(one.count) == least]
            break
    best = min(plans, key=lambda one: one.error)
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
    """Return the number of modes that half of the bank has room for.

    >>> padded(16), padded(17)
    (16, 32)
    """
    for half in HALF_SIZES:
        if count <= half:
            return half
    raise InputError(f"{count} modes", f"{HALF_SIZES[-1]} at most", "lower the sample rate")


def touch_weights(omega: Floats, step: float, beta: float) -> Floats:
    """Return g_n = (Omega_n / sin Omega_n)^beta of each mode."""
    turn = omega * step
    return (turn / np.sin(turn)) ** beta


def _best(string: StringParams, rate: Hertz, oversampling: int, partials: int, top: float) -> RatePlan:
    step = 1.0 / (rate * oversampling)
    count = mode_count(string, 1.0 / step, top)
    omega = mode_frequencies(string, EXACT_MODES * count)
    if omega[count - 1] * step > 0.9 * np.pi:
        return RatePlan(oversampling=oversampling, count=0, beta=0.0, error=np.inf)
    mass = 0.5 * string.linear_density * string.length
    at = TOUCH_POSITIONS * string.length
    shape = np.sin(np.outer(at, np.arange(1, omega.size + 1)) * np.pi / string.length) ** 2 / mass
    whole = static_compliance(string, at)
    partials = min(partials, count - 1)
    true = _zeros(shape, omega**2, whole - (shape / omega**2).sum(axis=1), partials, omega, lambda w: w * w)
    best = RatePlan(oversampling=oversampling, count=count, beta=0.0, error=np.inf)
    pole = np.tan(0.5 * omega[:count] * step) ** 2
    for beta in BETAS:
        static = shape[:, :count] * touch_weights(omega[:count], step, beta) / omega[:count] ** 2
        rest = whole - static.sum(axis=1)
        if (rest < 0.0).any():
            continue
        zeros = _zeros(static * pole, pole, rest, partials, omega, lambda w: np.tan(0.5 * w * step) ** 2)
        error = float(np.abs(1200.0 * np.log2(zeros / true)).max())
        if error < best.error:
            best = RatePlan(oversampling=oversampling, count=count, beta=float(beta), error=error)
    return best


def _zeros(residue: Floats, pole: Floats, rest: Floats, partials: int, omega: Floats, warp: object) -> Floats:
    """Return where, between poles, sum residue / (pole - warp(w)) + rest is zero."""
    low = np.tile(omega[:partials] * (1.0 + 1e-9), (residue.shape[0], 1))
    high = np.tile(omega[1 : partials + 1] * (1.0 - 1e-9), (residue.shape[0], 1))
    for _ in range(MAX_BISECTIONS):
        middle = 0.5 * (low + high)
        here = warp(middle)  # type: ignore[operator]
        value = (residue[:, None, :] / (pole - here[:, :, None])).sum(axis=2) + rest[:, None]
        low = np.where(value < 0.0, middle, low)
        high = np.where(value < 0.0, high, middle)
    return 0.5 * (low + high)
