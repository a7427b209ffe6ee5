"""Real wires compared with the ideal string: bending stiffness, which sharpens high partials, and losses."""

import math
from dataclasses import dataclass

import numpy as np

from monochord.core.ranges import Checked, Finite, NonNegative, Positive, checked
from monochord.core.types import Floats, StringParams
from monochord.core.units import Hertz, Metres
from monochord.physics.theory._checks import Number, refuse_infinite, refuse_not_positive, representable

STEEL_DENSITY = 7850.0
"""Density of plain carbon steel, in kg/m^3: the handbook value."""


def outer_diameter(string: StringParams) -> Metres:
    """Return the diameter of a solid steel string of the same weight.

    d = sqrt(4 mu / (pi rho)), rho = 7850 kg/m^3. For a plain string this is its gauge; a wound string, with
    air between its windings, is a few per cent thicker.

    Parameters
    ----------
    string
        The string; its linear density counts.

    Returns
    -------
    float
        d in m.

    Raises
    ------
    InputError
        If the linear density is not above zero.

    Examples
    --------
    >>> f"{outer_diameter(StringParams(length=0.65, linear_density=3.978e-4, tension=73.0)):.3e}"
    '2.540e-04'
    """
    refuse_not_positive(linear_density=string.linear_density)
    return math.sqrt(4.0 * string.linear_density / (math.pi * STEEL_DENSITY))


def bending_stiffness(string: StringParams) -> float:
    """Return the bending stiffness of a string in N m^2.

    E I with I = pi d^4 / 64 of the round core; windings do not add to it.

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


def support_shortening(string: StringParams) -> Metres:
    """Return by how much a point that supports a stiff string shortens the segment on either side.

    lambda / 2 with lambda = sqrt(E I / T), the distance over which a bent string becomes straight. A hinge
    does not shorten a segment; a clamp shortens it by lambda. A point support lets the slope continue to the
    other side, and so acts like half a clamp. Holds for partials whose waves are long beside lambda, on a
    segment whose neighbour does not sound with it.

    Parameters
    ----------
    string
        The string; zero `core_diameter` gives zero.

    Returns
    -------
    float
        In m.

    Raises
    ------
    InputError
        If the tension is not above zero.

    References
    ----------
    Fletcher and Rossing (1998), The Physics of Musical Instruments, section 2.18: hinged and clamped ends;
    the point support is derived here from the same beam.

    Examples
    --------
    >>> plain = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0, core_diameter=2.54e-4)
    >>> round(1e3 * support_shortening(plain), 3)
    0.396
    """
    refuse_not_positive(tension=string.tension)
    return 0.5 * math.sqrt(bending_stiffness(string) / string.tension)


def inharmonicity(string: StringParams, length: Metres | None = None) -> float:
    """Return the inharmonicity coefficient of the untouched string, or of a segment of it.

    B = pi^3 E d^4 / (64 T L^2), with d the diameter of the core: a wound string bends by its core. Zero for a
    string of no core diameter, which is ideally flexible. Holds for B n^2 well below one.

    Parameters
    ----------
    string
        The string.
    length
        L in m, above zero: that of a segment, or by default of the whole string.

    Returns
    -------
    float
        B, without unit.

    Raises
    ------
    InputError
        If the length is not above zero.

    References
    ----------
    Fletcher (1964), Normal vibration frequencies of a stiff piano string, J. Acoust. Soc. Am. 36, 203.

    Examples
    --------
    >>> plain = StringParams(length=0.65, linear_density=4.0e-4, tension=73.0, core_diameter=2.54e-4)
    >>> f"{inharmonicity(plain):.2e}, {inharmonicity(plain, 0.325):.2e}"
    '1.31e-05, 5.23e-05'
    """
    length = string.length if length is None else length
    refuse_not_positive(length=length)
    bending = math.pi**3 * string.young_modulus * string.core_diameter**4 / 64.0
    return bending / (string.tension * length**2)


@checked
@representable
def stiff_partials(f0: Positive[Hertz], inharmonicity: Finite[float], number: Number) -> Number:
    """Return partials of a stiff string between hinged ends.

    f_n = n f0 sqrt(1 + B n^2); f0 is the fundamental that the string would have without stiffness.

    Parameters
    ----------
    f0
        Fundamental without stiffness, in Hz, above zero.
    inharmonicity
        B, zero or more.
    number
        Partial numbers n, any shape.

    Returns
    -------
    float or array
        Frequencies in Hz, of the shape of `number`.

    Raises
    ------
    InputError
        If f0 is not above zero or 1 + B n^2 is not.

    References
    ----------
    Fletcher (1964), J. Acoust. Soc. Am. 36, 203, Eq. for hinged ends.

    Examples
    --------
    >>> stiff_partials(100.0, 1e-4, np.array([1, 10])).round(2)
    array([ 100.  , 1004.99])
    """
    stretch = 1.0 + inharmonicity * number**2
    refuse_infinite(f0=f0, stretch_of_partials=stretch)
    return number * f0 * stretch**0.5  # pyright: ignore[reportReturnType]


def partial_numbers(highest: Hertz, f0: Hertz, inharmonicity: float = 0.0) -> Floats:
    """Return the numbers of the partials at or below a frequency.

    Parameters
    ----------
    highest
        Upper limit in Hz.
    f0, inharmonicity
        Of the series, as in `stiff_partials`.

    Returns
    -------
    array (n,)
        1, 2, 3 ...; empty where the first one lies above.

    Examples
    --------
    >>> partial_numbers(1000.0, 300.0)
    array([1., 2., 3.])
    """
    refuse_not_positive(f0=f0)
    candidates = np.arange(1.0, max(math.floor(highest / f0), 0) + 1)
    return candidates[stiff_partials(f0, inharmonicity, candidates) <= highest]


@dataclass(frozen=True, slots=True, kw_only=True)
class Losses(Checked):
    """The loss factors of a vibrating string.

    `air_viscosity` in Pa s and `air_density` in kg/m^3 are those of ambient air. The others are
    dimensionless: `viscoelastic` is the loss angle of bending, `thermoelastic` the wire's inverse quality
    factor at any frequency (heat flow and dislocations), `support` that of the supports at the ends. The loss
    angle and the wire's factor have typical values of plain steel strings; the support's is assumed, for ends
    on a printed fixture, and is the largest loss.
    """

    air_viscosity: NonNegative[float] = 1.8e-5
    air_density: NonNegative[float] = 1.2
    viscoelastic: NonNegative[float] = 4.5e-3
    thermoelastic: NonNegative[float] = 2.0e-4
    support: NonNegative[float] = 1.0e-3


def decay_rates(string: StringParams, losses: Losses, frequencies: Floats) -> Floats:
    """Return the decay rates of partials: their amplitude falls as exp(-sigma t).

    sigma = pi f / Q, with 1/Q = 1/Q_air + 1/Q_ve + thermoelastic + support and

        1/Q_air = R / (2 pi mu f), R = 2 pi eta + 2 pi d sqrt(pi eta rho f),
        1/Q_ve = 4 pi^2 mu E I delta f^2 / T^2.

    R is Stokes' drag on a thin cylinder, d the `outer_diameter`: that of a solid steel string of the same
    weight. Q_ve holds while bending adds little to the frequency, B n^2 well below one, and is infinite for a
    string of no core diameter. `damping` of the string, one value for all partials, is not included.

    Parameters
    ----------
    string
        The string.
    losses
        Its loss factors.
    frequencies
        Of the partials, f in Hz, above zero; any shape.

    Returns
    -------
    array
        sigma in 1/s, of the shape of `frequencies`.

    Raises
    ------
    InputError
        If a frequency is not above zero.

    References
    ----------
    Valette and Cuesta (1993), Mecanique de la corde vibrante; Issanchou, Bilbao, Le Carrou, Touze and Doare
    (2017), J. Sound Vib. 393, 229. The drag is Stokes's of 1851.

    Examples
    --------
    >>> plain = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0, core_diameter=2.54e-4)
    >>> decay_rates(plain, Losses(), np.array([1000.0, 10000.0])).round(2)
    array([ 4.44, 41.64])
    """
    refuse_not_positive(frequencies=frequencies)
    viscosity, density = losses.air_viscosity, losses.air_density
    boundary = np.sqrt(np.pi * viscosity * density * frequencies)
    drag = 2.0 * np.pi * (viscosity + outer_diameter(string) * boundary)
    bending = bending_stiffness(string) * string.linear_density / string.tension**2
    viscoelastic = bending * losses.viscoelastic * (2.0 * np.pi * frequencies) ** 2
    inverse_quality = viscoelastic + losses.thermoelastic + losses.support
    return drag / (2.0 * string.linear_density) + np.pi * frequencies * inverse_quality
