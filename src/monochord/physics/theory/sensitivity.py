"""How much the frequencies of a touched string change with where and how hard it is touched."""

import numpy as np

from monochord.core.types import Contact, Floats, StringParams
from monochord.core.units import Hertz, Metres
from monochord.physics.theory._checks import Number, refuse_not_positive
from monochord.physics.theory.segments import split_frequencies
from monochord.physics.theory.tension import TensionLaw, stretch_stiffness, tension_from_force


def frequency_sensitivities(string: StringParams, contact: Contact, law: TensionLaw = "linear") -> Floats:
    """Return how both segment frequencies change with position and with force.

    With f1 = v / (2 x), f2 = v / (2 (L - x)) and v = sqrt(T / mu):

        df1/dx = -f1 / x + f1 T_x / (2 T),        df1/dF = f1 T_F / (2 T),
        df2/dx = f2 / (L - x) + f2 T_x / (2 T),   df2/dF = f2 T_F / (2 T),

    where T_x and T_F are the slopes of the tension law: (0, k_T) for the linear one.

    Parameters
    ----------
    string
        The string.
    contact
        Where and how hard it is touched.
    law
        How the force raises the tension.

    Returns
    -------
    array (2, 2)
        Rows f1 and f2; columns by position in Hz/m and by force in Hz/N.

    Raises
    ------
    InputError
        If the contact is not on the string, pulls, or the law is unknown.

    Examples
    --------
    A touch in the middle moves f1 and f2 oppositely with position, alike with force:

    >>> string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0, tension_per_force=6.0)
    >>> frequency_sensitivities(string, Contact(position=0.325, force=0.0)).round(1)
    array([[-1496.9,    22.5],
           [ 1496.9,    22.5]])
    """
    x, length = contact.position, string.length
    f1, f2 = split_frequencies(string, x, contact.force, law)
    tension = tension_from_force(string, contact.force, x, law)
    linear = (0.0, string.tension_per_force)
    slopes = linear if law == "linear" else _geometric_slopes(string, contact, tension)
    stretch = np.array(slopes) / (2.0 * tension)
    moved = np.array([[-1.0 / x, 0.0], [1.0 / (length - x), 0.0]])
    return np.array([[f1], [f2]]) * (stretch + moved)


def far_segment_sensitivity(frequency: Number, open_frequency: Hertz, length: Metres) -> Number:
    """Return how far the position moves for each hertz of the far segment's fundamental.

    dx/df = L f_open / f^2, from x = L (1 - f_open / f).

    Parameters
    ----------
    frequency
        Fundamental of the sounding segment in Hz.
    open_frequency
        Fundamental of the untouched string in Hz.
    length
        L in m.

    Returns
    -------
    float or array
        In m/Hz.

    Raises
    ------
    InputError
        If a quantity is not above zero.

    Examples
    --------
    At the twelfth fret of a low E string one hertz is two millimetres:

    >>> round(1e3 * far_segment_sensitivity(164.8, 82.4, 0.65), 2)
    1.97
    """
    refuse_not_positive(frequency=frequency, open_frequency=open_frequency, length=length)
    return length * open_frequency / frequency**2


def _geometric_slopes(string: StringParams, contact: Contact, tension: float) -> tuple[float, float]:
    # From T^2 (T - T0) = E A F^2 x (L - x) / (2 L^2), differentiated by x and by F.
    x, length, force = contact.position, string.length, contact.force
    cubic = tension * (3.0 * tension - 2.0 * string.tension)
    scale = stretch_stiffness(string) / (length**2 * cubic)
    return scale * force**2 * (length - 2.0 * x) / 2.0, scale * force * x * (length - x)
