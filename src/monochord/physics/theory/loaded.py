"""A string that leans on a spring at one point: its natural frequencies, and its own give there."""

import math

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats, StringParams
from monochord.core.units import Metres
from monochord.physics.theory._checks import Number, refuse_not_positive, refuse_outside

_HALVINGS = 60
"""Of a bracket no wider than pi: what is left lies below the spacing of floating-point numbers near pi."""


def loaded_frequencies(string: StringParams, position: Metres, stiffness: float, count: int) -> Floats:
    """Return the lowest natural frequencies of a string that a linear spring holds at one point.

    They solve (T/c) w [cot(w x / c) + cot(w (L - x) / c)] = -K, with w = 2 pi f and c = sqrt(T / mu): an
    ideally flexible string between firm ends on a spring without mass or loss. A mode with a node at x is
    not moved. K = 0 gives the harmonics of the untouched string, K infinite those of both segments together.
    The n-th frequency lies between the n-th of these two series, where it is found by bisection to the
    precision of floating point.

    Parameters
    ----------
    string
        The string; length, tension and linear density count.
    position
        Where the spring holds it, x in m, strictly inside the string.
    stiffness
        Of the spring, K in N/m, zero or more; infinite for a clamp.
    count
        How many frequencies, at least one.

    Returns
    -------
    array (count,)
        In Hz, ascending. Two are equal where both segments of a clamp sound alike.

    Raises
    ------
    InputError
        If the position is not inside the string, K is negative or the count is below one.

    Notes
    -----
    Derived here from the jump of slope at a point force; one spring interlaces the frequencies (Rayleigh).

    Examples
    --------
    >>> string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)
    >>> loaded_frequencies(string, 0.325, 1000.0, 3).round(2)
    array([368.66, 486.5 , 799.58])
    """
    refuse_outside(position, string.length)
    if not stiffness >= 0.0:
        raise InputError(f"stiffness {stiffness:g} N/m", "0 N/m or more", "a spring pushes back")
    if count < 1:
        raise InputError(f"count {count}", "1 or more")
    # In phi = w L / c: phi sin(phi) + K L / T sin(phi x / L) sin(phi (L - x) / L) = 0, without a pole.
    number = np.arange(1.0, count + 1)
    near, far = position / string.length, (string.length - position) / string.length
    load = stiffness * string.length / string.tension
    free, held = (1.0 / load, 1.0) if load > 1.0 else (1.0, load)
    low = number * math.pi
    clamped = np.sort(np.concatenate([low / near, low / far]))[:count]
    high = np.maximum(clamped, low)
    sign = np.where(number % 2 == 1.0, 1.0, -1.0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        above = sign * (free * middle * np.sin(middle) + held * np.sin(middle * near) * np.sin(middle * far))
        low, high = np.where(above > 0.0, middle, low), np.where(above > 0.0, high, middle)
    speed = math.sqrt(string.tension / string.linear_density)
    return (low + high) * (speed / (4.0 * math.pi * string.length))  # pyright: ignore[reportReturnType]


def static_compliance(string: StringParams, position: Number) -> Number:
    """Return how far a string gives way where it is pressed, per newton.

    C = [x (L - x) / L - sinh(a x) sinh(a (L - x)) / (a sinh(a L))] / T, with a = sqrt(T / (E I)): a tensioned
    stiff string between hinged ends under a point force, for small slopes and a tension that stays as it is.
    Without core diameter the second term vanishes. Where a L is well below one, bending bears the load and
    not tension, the terms nearly cancel and digits are lost; a L is some hundreds for a guitar string.

    Parameters
    ----------
    string
        The string; E I is its `bending_stiffness`.
    position
        Where it is pressed, x in m, strictly inside the string; any shape.

    Returns
    -------
    float or array
        C in m/N, of the shape of `position`.

    Raises
    ------
    InputError
        If a position is not inside the string.

    Notes
    -----
    Derived here: it is the sum over hinged modes of 2 sin^2(k x) / (L (T k^2 + E I k^4)), k = n pi / L.

    Examples
    --------
    >>> string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)
    >>> static_compliance(string, 0.325)
    0.0025
    """
    refuse_outside(position, string.length)
    flexible = position * (string.length - position) / string.length
    bending = bending_stiffness(string)
    if bending == 0.0:
        return flexible / string.tension  # pyright: ignore[reportReturnType]
    a = math.sqrt(string.tension / bending)
    # sinh(p) sinh(q) / sinh(p + q), with no exponent above zero.
    decay = np.expm1(-2.0 * a * position) * np.expm1(-2.0 * a * (string.length - position))
    rounding = -decay / (2.0 * a * np.expm1(-2.0 * a * string.length))
    result = (flexible - rounding) / string.tension
    return result if result.ndim else float(result)  # pyright: ignore[reportReturnType]


def bending_stiffness(string: StringParams) -> float:
    """Return the bending stiffness of a string in N m^2.

    E I with I = pi d^4 / 64 of the core, which is round: windings do not bend as one with it.

    Parameters
    ----------
    string
        The string; zero `core_diameter` gives zero.

    Returns
    -------
    float
        E I in N m^2.

    References
    ----------
    Fletcher (1964), Normal vibration frequencies of a stiff piano string, J. Acoust. Soc. Am. 36, 203.

    Examples
    --------
    >>> plain = StringParams(length=0.65, linear_density=4.0e-4, tension=73.0, core_diameter=2.54e-4)
    >>> f"{bending_stiffness(plain):.3e}"
    '4.086e-05'
    """
    refuse_not_positive(young_modulus=string.young_modulus)
    return string.young_modulus * math.pi * string.core_diameter**4 / 64.0
