"""Frequencies of the two segments of a touched string, and their exact inverse."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.lengths import refuse_other_units
from monochord.core.ranges import Positive, checked
from monochord.core.types import Contact, Floats, StringParams
from monochord.core.units import Hertz, KilogramsPerMetre, Metres, MetresPerSecond, Newtons, Seconds
from monochord.physics.theory._checks import (
    Number,
    refuse_infinite,
    refuse_not_positive,
    refuse_outside,
    representable,
)
from monochord.physics.theory.tension import TensionLaw, tension_from_force, wave_speed


def harmonic_frequencies(
    length: Metres, tension: Newtons, linear_density: KilogramsPerMetre, count: int
) -> Floats:
    """Return the first harmonics of an ideal string.

    f_n = n / (2 L) sqrt(T / mu), n = 1 ... count, for a flexible string between firm ends.

    Parameters
    ----------
    length, tension, linear_density
        L in m, T in N, mu in kg/m, all above zero.
    count
        Number of harmonics, at least one.

    Returns
    -------
    array (count,)
        Frequencies in Hz, ascending.

    Raises
    ------
    InputError
        If a quantity is not above zero.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, Eq. 2.

    Examples
    --------
    >>> harmonic_frequencies(0.65, 65.0, 6.5e-4, 2).round(2)
    array([243.25, 486.5 ])
    """
    refuse_not_positive(length=length, tension=tension, linear_density=linear_density, count=count)
    return np.arange(1, count + 1) * ((tension / linear_density) ** 0.5 / (2.0 * length))


@checked
@representable
def open_frequency(string: StringParams) -> Hertz:
    """Return the fundamental of the untouched string.

    f = v / (2 L) with v = sqrt(T0 / mu): Eq. 2 with n = 1.

    Examples
    --------
    >>> round(open_frequency(StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)), 2)
    243.25
    """
    return wave_speed(string) / (2.0 * string.length)


@checked
@representable
def segment_frequencies(
    string: StringParams, contact: Contact, law: TensionLaw = "linear"
) -> tuple[Hertz, Hertz]:
    """Return the fundamentals of both segments of a touched string.

    f1 = v / (2 x) and f2 = v / (2 (L - x)) with v = sqrt(T / mu): a touch that clamps a flexible string.
    Moving it raises one and lowers the other; pressing harder raises both.

    Parameters
    ----------
    string
        The string.
    contact
        Position and force of the touch; `position` is strictly inside the string.
    law
        Tension law.

    Returns
    -------
    f1, f2
        In Hz; f1 belongs to the segment of length x.

    Raises
    ------
    InputError
        If the position is not inside the string, the force is negative or the law unknown.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, Eq. 14.

    Examples
    --------
    The paper's appendix, x/L = 0.35 with no force:

    >>> string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0, tension_per_force=6.0)
    >>> f1, f2 = segment_frequencies(string, Contact(position=0.35 * 0.65, force=0.0))
    >>> round(f1, 1), round(f2, 1)
    (695.0, 374.2)
    """
    return split_frequencies(string, contact.position, contact.force, law)


def split_frequencies(
    string: StringParams, position: Number, force: Number, law: TensionLaw = "linear"
) -> tuple[Number, Number]:
    """Return `segment_frequencies` for arrays of positions and forces, broadcast together.

    Examples
    --------
    >>> string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)
    >>> f1, f2 = split_frequencies(string, np.array([0.13, 0.52]), np.zeros(2))
    >>> f1.round(1), f2.round(1)
    (array([1216.3,  304.1]), array([ 304.1, 1216.3]))
    """
    refuse_outside(position, string.length)
    half_speed = (tension_from_force(string, force, position, law) / string.linear_density) ** 0.5 / 2.0
    return half_speed / position, half_speed / (string.length - position)  # pyright: ignore[reportReturnType]


@checked
@representable
def locate_from_segments(length: Positive[Metres], f1: Number, f2: Number) -> Number:
    """Return the touch position from the fundamentals of a string's two segments.

    x = L f2 / (f1 + f2): exact for a clamping touch, for any tension, density and force.

    Parameters
    ----------
    length
        L in m.
    f1, f2
        Fundamentals in Hz of the segment at x = 0 and of the other, above zero.

    Returns
    -------
    float or array
        x in m.

    Raises
    ------
    InputError
        If the length or a frequency is not above zero.

    Examples
    --------
    >>> round(locate_from_segments(0.65, 695.0, 374.2), 4)
    0.2275
    """
    refuse_infinite(length=length, f1=f1, f2=f2)
    refuse_other_units(length=length)
    return length * f2 / (f1 + f2)


@checked
@representable
def tension_from_segments(string: StringParams, f1: Number, f2: Number) -> Number:
    """Return the tension of a touched string from the fundamentals of its two segments.

    T = mu (2 L f1 f2 / (f1 + f2))^2: exact for a clamping touch at any position.

    Parameters
    ----------
    string
        The string; its length and linear density are used.
    f1, f2
        Fundamentals in Hz, above zero.

    Returns
    -------
    float or array
        T in N.

    Raises
    ------
    InputError
        If a frequency is not above zero.

    Examples
    --------
    >>> string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)
    >>> round(tension_from_segments(string, 695.0, 374.231), 1)
    65.0
    """
    refuse_infinite(f1=f1, f2=f2)
    return string.linear_density * (2.0 * string.length * f1 * f2 / (f1 + f2)) ** 2


def position_from_far_segment(frequency: Number, open_frequency: Hertz, length: Metres) -> Number:
    """Return the touch position where only the segment beyond the touch sounds.

    x = L (1 - f_open / f), for a touch that does not change the tension; as when a finger stops a plucked
    string and x is counted from the nut.

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
        x in m; negative where `frequency` is below `open_frequency`.

    Raises
    ------
    InputError
        If a quantity is not above zero.

    Examples
    --------
    An octave up is the middle of the string:

    >>> position_from_far_segment(220.0, 110.0, 0.65)
    0.325
    """
    refuse_not_positive(frequency=frequency, open_frequency=open_frequency, length=length)
    refuse_other_units(length=length)
    return length * (1.0 - open_frequency / frequency)


def light_touch(position: Metres, length: Metres, tolerance: Metres) -> int | None:
    """Return n where a light touch at L / n sounds the note of a string that is stopped at a position.

    Stopped at x = (1 - 1/n) L, a string sounds n times its open note. So does the whole string where it is
    touched lightly at k L / n (a natural harmonic): its inharmonicity, n^2 B, is the same too, so that no
    window tells one from the other. At n = 2 both are at the middle.

    Parameters
    ----------
    position
        x in m, from the nut.
    length
        L in m.
    tolerance
        Largest distance in m of the position from (1 - 1/n) L.

    Returns
    -------
    int or None
        n from 3 to 8, None where a light touch sounds another note.

    Raises
    ------
    InputError
        If a quantity is not above zero.

    Examples
    --------
    >>> light_touch(0.4333, 0.65, 2e-3), light_touch(0.40, 0.65, 2e-3)
    (3, None)
    """
    refuse_not_positive(length=length, tolerance=tolerance)
    near = [n for n in range(3, 9) if abs(position - (1.0 - 1.0 / n) * length) <= tolerance]
    return near[0] if near else None


def mixing_matrix(share_1: float, share_2: float) -> Floats:
    """Return the matrix of two microphones that pick up two segments: B = mixing @ A.

    [[l1, 1 - l1], [1 - l2, l2]]; (1, 1) is perfect isolation, (0.5, 0.5) leaves no difference at all.

    Parameters
    ----------
    share_1, share_2
        Shares l1 and l2 of the near segment in each microphone's signal, from 0 to 1.

    Returns
    -------
    array (2, 2)
        Rows are microphones, columns segments.

    Raises
    ------
    InputError
        If a share is outside 0 to 1.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, Eq. 5.

    Examples
    --------
    >>> mixing_matrix(0.9, 0.75)
    array([[0.9 , 0.1 ],
           [0.25, 0.75]])
    """
    for share in (share_1, share_2):
        if not 0.0 <= share <= 1.0:
            raise InputError(f"microphone share {share:g}", "0 to 1")
    return np.array([[share_1, 1.0 - share_1], [1.0 - share_2, share_2]])


def step_limit(spacing: Metres, speed: MetresPerSecond, alpha: float = 1.0) -> Seconds:
    """Return the time step below which the central-difference scheme is stable.

    dt < alpha dxi / v, with alpha in (0, 1] as the safety factor (Courant, Friedrichs and Lewy 1928).

    Parameters
    ----------
    spacing
        Node spacing dxi in m.
    speed
        Wave speed v in m/s.
    alpha
        Safety factor.

    Returns
    -------
    float
        The limit in s; a step must be strictly below it.

    Raises
    ------
    InputError
        If a quantity is not above zero or alpha is above one.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, Eq. 13.

    Examples
    --------
    >>> round(1e6 * step_limit(0.2275 / 255, 316.23), 2)
    2.82
    """
    refuse_not_positive(spacing=spacing, speed=speed, alpha=alpha)
    if alpha > 1.0:
        raise InputError(f"alpha {alpha:g}", "above 0, at most 1", "the scheme is unstable beyond")
    return alpha * spacing / speed
