"""Partials of a stiff string: bending stiffness sharpens the high ones."""

import math

import numpy as np

from monochord.core.types import Floats, StringParams
from monochord.core.units import Hertz, Metres
from monochord.physics.theory._checks import Number, refuse_not_positive


def inharmonicity(string: StringParams) -> float:
    """Return the inharmonicity coefficient of the untouched string.

    B = pi^3 E d^4 / (64 T L^2), with d the diameter of the core: a wound string bends by its core. Zero for a
    string of no core diameter, which is ideally flexible. Holds for B n^2 well below one.

    Parameters
    ----------
    string
        The string.

    Returns
    -------
    float
        B, without unit.

    References
    ----------
    Fletcher (1964), Normal vibration frequencies of a stiff piano string, J. Acoust. Soc. Am. 36, 203.

    Examples
    --------
    >>> plain = StringParams(length=0.65, linear_density=4.0e-4, tension=73.0, core_diameter=2.54e-4)
    >>> f"{inharmonicity(plain):.2e}"
    '1.31e-05'
    """
    return segment_inharmonicity(string, string.length)


def segment_inharmonicity(string: StringParams, length: Metres) -> float:
    """Return the inharmonicity coefficient of a segment: B goes with one over the square of its length.

    Parameters
    ----------
    string
        The string that the segment is part of.
    length
        Length of the segment in m, above zero.

    Returns
    -------
    float
        B, without unit.

    Raises
    ------
    InputError
        If the length is not above zero.

    Examples
    --------
    >>> plain = StringParams(length=0.65, linear_density=4.0e-4, tension=73.0, core_diameter=2.54e-4)
    >>> round(segment_inharmonicity(plain, 0.325) / inharmonicity(plain), 6)
    4.0
    """
    refuse_not_positive(length=length)
    bending = math.pi**3 * string.young_modulus * string.core_diameter**4 / 64.0
    return bending / (string.tension * length**2)


def stiff_partials(f0: Hertz, inharmonicity: float, number: Number) -> Number:
    """Return partials of a stiff string between hinged ends.

    f_n = n f0 sqrt(1 + B n^2); f0 is the fundamental that the string would have without stiffness.

    Parameters
    ----------
    f0
        In Hz, above zero.
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
    refuse_not_positive(f0=f0, stretch_of_partials=stretch)
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
        1, 2, 3 ...; empty where even the first lies above.

    Examples
    --------
    >>> partial_numbers(1000.0, 300.0)
    array([1., 2., 3.])
    """
    refuse_not_positive(f0=f0)
    candidates = np.arange(1.0, max(math.floor(highest / f0), 0) + 1)
    return candidates[stiff_partials(f0, inharmonicity, candidates) <= highest]
