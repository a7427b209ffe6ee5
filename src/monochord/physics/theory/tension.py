"""Tension, wave speed and damping of a pressed string."""

from typing import Literal, TypeAlias, overload

import numpy as np

from monochord.core.errors import InputError
from monochord.core.ranges import checked
from monochord.core.types import Floats, StringParams
from monochord.core.units import Pascals
from monochord.physics.theory._checks import (
    Number,
    refuse_infinite,
    refuse_negative_force,
    refuse_not_positive,
    refuse_outside,
    representable,
)

TensionLaw: TypeAlias = Literal["linear", "geometric"]
"""Tension law: the paper's trend k_T F, or the stretch of the deflected string."""
STRENGTH: Pascals = 3.0e9
"""Tensile strength of 0.25 mm music wire in Pa, the strongest used for strings (ASTM A228)."""


def linear_tension(string: StringParams, force: Number) -> Number:
    """Return the tension of a pressed string by the linear law.

    T(F) = T0 + k_T F, the paper's tunable trend for small deformations; the position of the press has no
    effect.

    Parameters
    ----------
    string
        The string; `tension_per_force` is k_T in N/N.
    force
        Normal force F in N, any shape.

    Returns
    -------
    float or array
        T in N, of the shape of `force`.

    Raises
    ------
    InputError
        If a force is negative.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, Eq. 6.

    Examples
    --------
    >>> appendix = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0, tension_per_force=6.0)
    >>> linear_tension(appendix, 0.5)
    68.0
    """
    refuse_negative_force(force)
    return string.tension + string.tension_per_force * force


def geometric_tension(string: StringParams, position: Number, force: Number) -> Number:
    """Return the tension of a pressed string by the geometric law.

    A press F at x deflects the string to a triangle of depth delta = F x (L - x) / (T L). Its sides are
    longer than L by delta^2 L / (2 x (L - x)), and that times E A / L is the rise of tension. Together,

        T^2 (T - T0) = E A F^2 x (L - x) / (2 L^2),

    a cubic whose one root above T0 is returned in closed form. The rise goes with F^2 for a light press.
    Holds for small slopes (delta much less than x and L - x), firm ends and a point load. A string of no
    core diameter has no stretch stiffness here and keeps T0.

    Parameters
    ----------
    string
        The string; E is `young_modulus` and A the cross-section of `core_diameter`.
    position
        Pressed position x in m, strictly inside the string.
    force
        Normal force F in N.

    Returns
    -------
    float or array
        T in N; `position` and `force` are broadcast.

    Raises
    ------
    InputError
        If a position is not inside the string or a force is negative.

    Notes
    -----
    Derived here from the statics of a loaded string and Hooke's law.

    Examples
    --------
    >>> plain = StringParams(length=0.65, linear_density=4.0e-4, tension=73.0, core_diameter=2.54e-4)
    >>> round(geometric_tension(plain, 0.325, 0.0), 6), round(geometric_tension(plain, 0.325, 2.0), 3)
    (73.0, 73.927)
    """
    refuse_negative_force(force)
    refuse_outside(position, string.length)
    # With u = T0 / T the cubic reads k u^3 + u = 1, which has one real root, a hyperbolic sine.
    load = stretch_stiffness(string) * force**2 * position * (string.length - position)
    k = load / (2.0 * string.length**2 * string.tension**3)
    w = np.sqrt(3.0 * k)
    root = 2.0 * np.sinh(np.arcsinh(1.5 * w) / 3.0)
    rest = w == 0.0
    u = np.where(rest, 1.0, np.minimum(root / np.where(rest, 1.0, w), 1.0))
    return string.tension / (u if u.ndim else float(u))  # pyright: ignore[reportReturnType]


def breaking_force(string: StringParams, position: Number) -> Number:
    """Return the normal force at which a string's wire breaks.

    It breaks at the tension Tb = `STRENGTH` times its cross-section A. The geometric law, solved for F, gives

        F = Tb L sqrt(2 (Tb - T0) / (E A x (L - x))),

    T0 being the tension at rest. It is an upper bound: it assumes small slopes, and friction at the ends,
    bending over an edge and wear break a wire earlier. Near an end the bound diverges with the slope; there
    the force at a hundredth of the length is used.

    Parameters
    ----------
    string
        The string, with a core diameter.
    position
        Pressed position x in m.

    Returns
    -------
    float or array
        F in N, of the shape of `position`.

    Raises
    ------
    InputError
        If the core has no diameter.

    Examples
    --------
    >>> plain = StringParams(length=0.2, linear_density=4.0e-4, tension=65.0, core_diameter=2.54e-4)
    >>> round(breaking_force(plain, 0.1))
    40
    """
    refuse_not_positive(core_diameter=string.core_diameter)
    length, area = string.length, 0.25 * np.pi * string.core_diameter**2
    most = max(STRENGTH * area, 1.1 * string.tension)
    place = np.clip(position, 0.01 * length, 0.99 * length)
    lever = stretch_stiffness(string) * place * (length - place)
    force = most * length * np.sqrt(2.0 * (most - string.tension) / lever)
    return force if force.ndim else float(force)  # pyright: ignore[reportReturnType]


def stretch_stiffness(string: StringParams) -> float:
    """Return E A of the load-bearing wire in N: the force that would double its length.

    Examples
    --------
    >>> string = StringParams(length=0.65, linear_density=4.0e-4, tension=73.0, core_diameter=2.54e-4)
    >>> round(stretch_stiffness(string))
    10134
    """
    return string.young_modulus * np.pi * string.core_diameter**2 / 4.0


def damping_under(string: StringParams, force: Number) -> Number:
    """Return the damping per unit length of a pressed string.

    d(F) = d0 + k_d F, one value for both segments; the amplitude of a free segment falls by e in 2 mu / d.

    Parameters
    ----------
    string
        The string; `damping` is d0 in N s / m^2, `damping_per_force` is k_d in s / m^2.
    force
        Normal force F in N, any shape.

    Returns
    -------
    float or array
        d in N s / m^2, of the shape of `force`.

    Raises
    ------
    InputError
        If a force is negative.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, Eq. 7.

    Examples
    --------
    >>> string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0, damping_per_force=0.01)
    >>> damping_under(string, 2.0)
    0.04
    """
    refuse_negative_force(force)
    return string.damping + string.damping_per_force * force


@overload
def wave_speed(string: StringParams, force: float = ...) -> float: ...
@overload
def wave_speed(string: StringParams, force: Floats) -> Floats: ...
def wave_speed(string: StringParams, force: float | Floats = 0.0) -> float | Floats:
    """Return the speed of transverse waves on a string pressed with a force (linear law).

    v = sqrt(T(F) / mu), for an ideally flexible string.

    Parameters
    ----------
    string
        The string.
    force
        Normal force F in N; zero for the untouched string.

    Returns
    -------
    float or array
        v in m/s, of the shape of `force`.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, Eq. 10.

    Examples
    --------
    >>> round(wave_speed(StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)), 2)
    316.23
    """
    return (linear_tension(string, force) / string.linear_density) ** 0.5  # pyright: ignore[reportArgumentType]


def tension_from_force(
    string: StringParams,
    force: Number,
    position: Number | None = None,
    law: TensionLaw = "linear",
) -> Number:
    """Return the tension of a pressed string by either law: `linear_tension` or `geometric_tension`.

    Parameters
    ----------
    string
        The string.
    force
        Normal force F in N.
    position
        Pressed position in m, required by the geometric law.
    law
        ``"linear"`` or ``"geometric"``.

    Returns
    -------
    float or array
        T in N.

    Raises
    ------
    InputError
        If the law is unknown, a force is negative, or the geometric law lacks a position on the string.

    Examples
    --------
    >>> plain = StringParams(length=0.65, linear_density=4.0e-4, tension=73.0, core_diameter=2.54e-4)
    >>> tension_from_force(plain, 2.0), round(tension_from_force(plain, 2.0, 0.325, "geometric"), 3)
    (73.0, 73.927)
    """
    if check_law(law) == "linear":
        return linear_tension(string, force)
    return geometric_tension(string, _required(position), force)


@checked
@representable
def force_from_tension(
    string: StringParams,
    tension: Number,
    position: Number | None = None,
    law: TensionLaw = "linear",
) -> Number:
    """Return the normal force that gives a tension: the inverse of either law.

    Linear: F = (T - T0) / k_T, which is negative where the tension has fallen below T0.
    Geometric: F = T sqrt(2 L^2 (T - T0) / (E A x (L - x))), NaN where no press raises the tension so.

    Parameters
    ----------
    string
        The string at rest.
    tension
        T in N.
    position
        Pressed position in m, required by the geometric law.
    law
        ``"linear"`` or ``"geometric"``.

    Returns
    -------
    float or array
        F in N.

    Raises
    ------
    InputError
        If the law is unknown, or its inputs are missing: k_T, or a core diameter and a position.

    Examples
    --------
    >>> appendix = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0, tension_per_force=6.0)
    >>> force_from_tension(appendix, 68.0)
    0.5
    """
    refuse_infinite(tension=tension)
    if check_law(law) == "linear":
        if string.tension_per_force == 0.0:
            raise InputError("tension per force 0", "a string whose tension depends on force", "set k_T")
        return (tension - string.tension) / string.tension_per_force
    position = _required(position)
    refuse_outside(position, string.length)
    if string.core_diameter == 0.0:
        raise InputError("core diameter 0", "above 0 for the geometric law", "set the core's diameter")
    rise = np.maximum(tension - string.tension, 0.0)
    square = (
        2.0 * string.length**2 * rise / (stretch_stiffness(string) * position * (string.length - position))
    )
    force = np.where(tension >= string.tension, tension * np.sqrt(square), np.nan)
    return force if force.ndim else float(force)  # pyright: ignore[reportReturnType]


def check_law(law: str) -> str:
    """Return the name of a tension law, or raise `InputError`.

    Examples
    --------
    >>> check_law("geometric")
    'geometric'
    """
    if law not in {"linear", "geometric"}:
        raise InputError(f"tension law '{law}'", "linear, geometric")
    return law


def _required(position: Number | None) -> Number:
    if position is None:
        raise InputError("no position", "a position in m", "the geometric law needs it")
    return position
