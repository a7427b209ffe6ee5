"""A string against an object: Hertz contact, and a string loaded at one point by a spring or a force."""

import math

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats, StringParams
from monochord.core.units import Metres, Pascals
from monochord.physics.theory._checks import (
    Number,
    refuse_negative_force,
    refuse_not_positive,
    refuse_outside,
)
from monochord.physics.theory.stiffness import bending_stiffness, outer_diameter

STEEL_POISSON_RATIO = 0.3
"""Poisson ratio of steel: the handbook value."""
_MAX_BISECTIONS = 60
"""Of a bracket no wider than pi: the error is below the spacing of floating-point numbers near pi."""


def hertz_stiffness(
    string: StringParams, radius: Metres, young_modulus: Pascals, poisson_ratio: float
) -> float:
    """Return the contact stiffness of a string pressed against a cylinder across it.

    f = k delta^(3/2) with k = (2 pi E* / (3 K))^(3/2) sqrt(3 D / (2 pi E* A)): Hertz's elliptic contact.
    A is half of the smaller of the curvatures 1/R and 2/d; K and E are the complete elliptic integrals
    and D = (K - E)/m, all of the parameter m, one less the squared ratio of the ellipse's axes, which
    follows from the ratio of the curvatures. 1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2. Holds for smooth
    elastic bodies, an ellipse small beside d and R, and no friction. A flat object touches along a line,
    for which no such law exists, and raises; towards it k grows slowly without limit.

    Parameters
    ----------
    string
        The string, of steel: `young_modulus`, Poisson ratio 0.3, `outer_diameter`.
    radius
        Of the object, R in m: above zero and finite.
    young_modulus
        Of the object, in Pa; infinite for a rigid one.
    poisson_ratio
        Of the object, above -1 and at most 0.5.

    Returns
    -------
    float
        k in N/m^1.5.

    Raises
    ------
    InputError
        If the radius, a modulus or the Poisson ratio is out of its range.

    References
    ----------
    Johnson (1985), Contact Mechanics, section 4.2; the elliptic integrals after Abramowitz and Stegun, 17.6.

    Examples
    --------
    >>> plain = StringParams(length=0.65, linear_density=3.978e-4, tension=73.0)
    >>> f"{hertz_stiffness(plain, 5.0e-3, 2.0e9, 0.35):.2e}"
    '1.08e+08'
    """
    modulus, _, integral, major_per_force = _hertz(string, radius, young_modulus, poisson_ratio)
    return (2.0 * math.pi * modulus / (3.0 * integral)) ** 1.5 * math.sqrt(major_per_force)


def line_stiffness(
    string: StringParams, width: Metres, young_modulus: Pascals, poisson_ratio: float
) -> float:
    """Return the contact stiffness of a string pressed against a flat object, which touches along a line.

    f = k delta with k = pi E* w / 4: a cylinder that lies on a half-space over a length w. Two-dimensional
    contact has no size-independent law, since its approach depends logarithmically on the size of the bodies;
    this one is exact for the contact's one-dimensional image. Holds for a string with even contact.

    Parameters
    ----------
    string
        The string, of steel: `young_modulus`, Poisson ratio 0.3.
    width
        Length of the line, w in m: above zero.
    young_modulus, poisson_ratio
        Of the object, as in `hertz_stiffness`.

    Returns
    -------
    float
        k in N/m.

    Raises
    ------
    InputError
        If the width, a modulus or the Poisson ratio is out of its range.

    References
    ----------
    Popov (2010), Contact Mechanics and Friction, chapter 5: cylinders with parallel axes.

    Examples
    --------
    >>> plain = StringParams(length=0.65, linear_density=3.978e-4, tension=73.0)
    >>> f"{line_stiffness(plain, 2.0e-3, 2.0e9, 0.35):.2e}"
    '3.54e+06'
    """
    refuse_not_positive(width=width)
    return 0.25 * math.pi * _shared_modulus(string, young_modulus, poisson_ratio) * width


def contact_width(
    string: StringParams, radius: Metres, young_modulus: Pascals, poisson_ratio: float, force: Number
) -> Number:
    """Return the length of string in contact with an object.

    The axis of Hertz's ellipse along the string, plus the wrap: a press F turns the string by F / T, so that
    an ideally flexible one lies on the arc R F / T. A stiff string turns by lambda / R on each side before it
    makes contact, lambda = sqrt(E I / T): then the wrap is R F / T - 2 lambda, and zero below F = 2 sqrt(E I
    T) / R. Holds for small turns; where the wrap is long the sum is an upper estimate.

    Parameters
    ----------
    string
        The string, of steel; its tension at rest counts.
    radius, young_modulus, poisson_ratio
        Of the object, as in `hertz_stiffness`.
    force
        Normal force F in N, zero or more; any shape.

    Returns
    -------
    float or array
        Width in m, of the shape of `force`.

    Raises
    ------
    InputError
        As `hertz_stiffness`, or if a force is negative.

    References
    ----------
    Johnson (1985), Contact Mechanics, section 4.2. The wrap is derived here from the tensioned beam.

    Examples
    --------
    >>> plain = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0, core_diameter=2.54e-4)
    >>> round(1e3 * contact_width(plain, 5.0e-3, 2.0e9, 0.35, 1.0), 3)
    0.36
    """
    refuse_negative_force(force)
    _, squared, _, major_per_force = _hertz(string, radius, young_modulus, poisson_ratio)
    along = 1.0 if radius >= outer_diameter(string) / 2.0 else math.sqrt(squared)
    wrap = radius * force / string.tension - 2.0 * math.sqrt(bending_stiffness(string) / string.tension)
    return 2.0 * along * (major_per_force * force) ** (1.0 / 3.0) + wrap * (wrap > 0.0)  # pyright: ignore[reportReturnType]


def edge_distance(string: StringParams, width: Metres, stiffness: float) -> Metres:
    """Return how far apart two edges are that hold a string as an elastic line of contact does.

    e^2 = w^2 (1 + 2 p) / 3 with p = r^4 / (r^4 + 4.5^4), r = w / (4 E I / kappa)^(1/4), kappa = k / w: a line
    that is soft beside the string's bending moves as one, and its two edges are as far apart as its pressure
    is wide; a firm one bears the string at its ends. Fitted to a stiff string on an elastic foundation: what
    the segments' frequencies say of the tension then is right to 0.2 N of 65 N for contacts of 0.3 to 3 mm of
    wood to steel.

    Parameters
    ----------
    string
        The string; E I is its `bending_stiffness`.
    width
        Length of the line, w in m: above zero.
    stiffness
        Of the whole line, k in N/m: above zero.

    Returns
    -------
    float
        e in m, from 0.58 w to w.

    Raises
    ------
    InputError
        If the width or the stiffness is not above zero.

    Notes
    -----
    The two limits follow from the second moment of an even pressure and of two edges; p is fitted here.

    Examples
    --------
    >>> plain = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0, core_diameter=2.54e-4)
    >>> [round(1e3 * edge_distance(plain, 2.0e-3, k), 2) for k in (1e4, 4e6, 1e9)]
    [1.16, 1.48, 1.99]
    """
    refuse_not_positive(width=width, stiffness=stiffness)
    bent = 4.5**4 * 4.0 * bending_stiffness(string) * width / stiffness
    firm = width**4 / (width**4 + bent)
    return width * math.sqrt((1.0 + 2.0 * firm) / 3.0)


def turning_stiffness(string: StringParams, radius: Metres, force: Number) -> Number:
    """Return the stiffness with which a round object resists the turning of a string that presses on it.

    k = F R / (1 - F R / (2 sqrt(E I T))). A string that turns by theta rolls on the object: the middle of the
    contact moves by R theta, whatever the contact's law, and the force with it, which is a moment F R theta.
    R is that of the object beside the string's own curvature, F / (2 sqrt(E I T)) under a point load, which
    follows from the tensioned beam. Where the string begins to wrap, F = 2 sqrt(E I T) / R, k grows without
    end. Holds for small turns of smooth bodies without friction, that are held firmly.

    Parameters
    ----------
    string
        The string: tension and bending stiffness count.
    radius
        Of the object, R in m: above zero.
    force
        Normal force F in N, zero or more; any shape.

    Returns
    -------
    float or array
        k in N m/rad, of the shape of `force`; infinite where the string wraps, or is ideally flexible.

    Raises
    ------
    InputError
        If the radius is not above zero or a force is negative.

    Notes
    -----
    Derived here. A potential U(delta + R theta^2 / 2) gives force and moment: a tilted line enters a circle
    deeper by R theta^2 / 2.

    Examples
    --------
    >>> plain = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0, core_diameter=2.54e-4)
    >>> f"{turning_stiffness(plain, 5.0e-3, 1.0):.2e}"
    '5.25e-03'
    """
    refuse_negative_force(force)
    refuse_not_positive(radius=radius)
    whole = 2.0 * math.sqrt(bending_stiffness(string) * string.tension)
    moment = radius * np.asarray(force, dtype=np.float64)
    share = np.divide(moment, whole, out=np.full_like(moment, np.inf), where=whole > 0.0)
    rolls = share < 1.0
    stiffness = np.where(rolls, moment / np.where(rolls, 1.0 - share, 1.0), np.inf)
    stiffness = np.where(moment == 0.0, 0.0, stiffness)
    return stiffness if stiffness.ndim else float(stiffness)  # pyright: ignore[reportReturnType]


def mindlin_ratio(poisson_ratio: float) -> float:
    """Return the ratio of tangential to normal stiffness of a contact that does not slide.

    k_t / k_n = 2 (1 - nu) / (2 - nu), the tangents of force over displacement, for a circular contact of two
    bodies of the same Poisson ratio. For an ellipse it depends somewhat on the direction.

    Parameters
    ----------
    poisson_ratio
        nu, above -1 and at most 0.5.

    Returns
    -------
    float
        The ratio, without unit: from 2/3 at nu 0.5 to 1 at nu 0 for common materials.

    Raises
    ------
    InputError
        If nu is out of its range.

    References
    ----------
    Mindlin (1949), Compliance of elastic bodies in contact, J. Appl. Mech. 16, 259; Johnson (1985), Contact
    Mechanics, section 7.2.

    Examples
    --------
    >>> round(mindlin_ratio(0.3), 4)
    0.8235
    """
    _refuse_poisson(poisson_ratio)
    return 2.0 * (1.0 - poisson_ratio) / (2.0 - poisson_ratio)


def _hertz(
    string: StringParams, radius: Metres, young_modulus: Pascals, poisson_ratio: float
) -> tuple[Pascals, float, float, float]:
    """Return E*, the modulus of both bodies, and of the ellipse: squared axis ratio, K, long axis^3 over F.

    The long axis is half the ellipse's length, and A the lesser curvature of the gap A x^2 + B y^2.
    """
    modulus = _shared_modulus(string, young_modulus, poisson_ratio)
    squared, integral, part = _ellipse(string, radius)
    least_curvature = 0.5 / max(radius, outer_diameter(string) / 2.0)
    return modulus, squared, integral, 3.0 * part / (2.0 * math.pi * modulus * least_curvature)


def _shared_modulus(string: StringParams, young_modulus: Pascals, poisson_ratio: float) -> Pascals:
    """Return E* of string and object: 1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2."""
    refuse_not_positive(young_modulus_of_the_string=string.young_modulus, young_modulus=young_modulus)
    _refuse_poisson(poisson_ratio)
    string_part = (1.0 - STEEL_POISSON_RATIO**2) / string.young_modulus
    return 1.0 / (string_part + (1.0 - poisson_ratio**2) / young_modulus)


def _refuse_poisson(poisson_ratio: float) -> None:
    if not -1.0 < poisson_ratio <= 0.5:
        raise InputError(f"Poisson ratio {poisson_ratio:g}", "above -1 and at most 0.5")


def _ellipse(string: StringParams, radius: Metres) -> tuple[float, float, float]:
    """Return the squared ratio of the short to the long axis, and K and D of that ellipse."""
    refuse_not_positive(radius=radius)
    if math.isinf(radius):
        raise InputError("radius inf", "a finite radius", "use line_stiffness for a flat object")
    ratio = radius / (outer_diameter(string) / 2.0)
    ratio = max(ratio, 1.0 / ratio)
    # B / A = (1 - D/K) / (p D/K) falls from infinity to one as p grows to one; bisected in log p.
    low, high = math.log(1e-300), 0.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        squared = math.exp(middle)
        integral, part = _elliptic(squared)
        low, high = (middle, high) if integral - part > ratio * squared * part else (low, middle)
    squared = math.exp(0.5 * (low + high))
    return squared, *_elliptic(squared)


def _elliptic(complement: float) -> tuple[float, float]:
    """Return K(m) and D(m) = (K(m) - E(m)) / m at m = 1 - `complement`, by the arithmetic-geometric mean."""
    root = math.sqrt(complement)
    mean, geometric = 0.5 * (1.0 + root), math.sqrt(root)
    # The sum of 2^(n-1) c_n^2 / m, which is D / K; dividing by m beforehand keeps it whole as m vanishes.
    term, weight = 0.25 * (1.0 - root) / (1.0 + root), 1.0
    share = 0.5 + term
    while term * weight > 1e-17 * share:
        mean, geometric = 0.5 * (mean + geometric), math.sqrt(mean * geometric)
        term, weight = (1.0 - complement) * term**2 / (16.0 * mean**2), 2.0 * weight
        share += weight * term
    integral = math.pi / (mean + geometric)
    return integral, share * integral


def loaded_frequencies(string: StringParams, position: Metres, stiffness: float, count: int) -> Floats:
    """Return the lowest natural frequencies of a string held at one point by a linear spring.

    They solve (T/c) w [cot(w x / c) + cot(w (L - x) / c)] = -K, with w = 2 pi f and c = sqrt(T / mu): an
    ideally flexible string between firm ends on a spring without mass or loss. A mode with a node at x is
    unaffected. K = 0 gives the harmonics of the untouched string, K infinite those of both segments together.
    The n-th frequency lies between the n-th of these two series, from which it follows by bisection to the
    precision of floating point.

    Parameters
    ----------
    string
        The string; length, tension and linear density count.
    position
        Position x of the spring in m, strictly inside the string.
    stiffness
        Of the spring, K in N/m, zero or more; infinite for a clamp.
    count
        Number of frequencies, at least one.

    Returns
    -------
    array (count,)
        In Hz, ascending. Two are equal where both segments of a clamp have a common frequency.

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
        raise InputError(f"stiffness {stiffness:g} N/m", "0 N/m or more", "use a positive stiffness")
    if count < 1:
        raise InputError(f"count {count}", "1 or more")
    # In phi = w L / c: phi sin(phi) + K L / T sin(phi x / L) sin(phi (L - x) / L) = 0, without a pole.
    number = np.arange(1.0, count + 1)
    near, far = position / string.length, (string.length - position) / string.length
    load = stiffness * string.length / string.tension
    free, spring = (1.0 / load, 1.0) if load > 1.0 else (1.0, load)
    low = number * math.pi
    clamped = np.sort(np.concatenate([low / near, low / far]))[:count]
    high = np.maximum(clamped, low)
    sign = np.where(number % 2 == 1.0, 1.0, -1.0)
    for _ in range(_MAX_BISECTIONS):
        middle = 0.5 * (low + high)
        above = sign * (
            free * middle * np.sin(middle) + spring * np.sin(middle * near) * np.sin(middle * far)
        )
        low, high = np.where(above > 0.0, middle, low), np.where(above > 0.0, high, middle)
    speed = math.sqrt(string.tension / string.linear_density)
    return (low + high) * (speed / (4.0 * math.pi * string.length))  # pyright: ignore[reportReturnType]


def static_compliance(string: StringParams, position: Number) -> Number:
    """Return the static compliance of a string at the pressed position.

    C = [x (L - x) / L - sinh(a x) sinh(a (L - x)) / (a sinh(a L))] / T, with a = sqrt(T / (E I)): a tensioned
    stiff string between hinged ends under a point force, for small slopes and constant tension. Without core
    diameter the second term vanishes. Where a L is well below one, bending bears the load instead of tension,
    the terms nearly cancel and digits are lost; a L is some hundreds for a guitar string.

    Parameters
    ----------
    string
        The string; E I is its `bending_stiffness`.
    position
        Pressed position x in m, strictly inside the string; any shape.

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


def mutual_compliance(string: StringParams, first: Number, second: Number) -> Number:
    """Return the static deflection of a string at one place by a newton at another, in m/N.

    C = [a (L - b) / L - sinh(q a) sinh(q (L - b)) / (q sinh(q L))] / T, with q = sqrt(T / (E I)) and a the
    smaller of the two places: `static_compliance` is its value where they are one.

    Parameters
    ----------
    string
        The string; E I is its `bending_stiffness`.
    first, second
        The places in m, strictly inside the string; any shapes that broadcast.

    Returns
    -------
    float or array
        In m/N.

    Raises
    ------
    InputError
        If a place is not inside the string.

    Examples
    --------
    >>> string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)
    >>> round(mutual_compliance(string, 0.325, 0.1), 6)
    0.000769
    """
    refuse_outside(first, string.length)
    refuse_outside(second, string.length)
    near, far = np.minimum(first, second), string.length - np.maximum(first, second)
    flexible = near * far / string.length
    bending = bending_stiffness(string)
    rounding = np.zeros_like(flexible)
    if bending > 0.0:
        a = math.sqrt(string.tension / bending)
        between = np.exp(-a * (string.length - near - far))
        decay = np.expm1(-2.0 * a * near) * np.expm1(-2.0 * a * far) * between
        rounding = -decay / (2.0 * a * np.expm1(-2.0 * a * string.length))
    result = (flexible - rounding) / string.tension
    return result if result.ndim else float(result)  # pyright: ignore[reportReturnType]


def turning_compliance(string: StringParams, position: Number, width: Metres = 0.0) -> Number:
    """Return the static turn of a string by a moment at a place, in rad/(N m).

    Of a pair of forces `width` apart, and of the difference of the string's heights there over the width:
    [C(a, a) + C(b, b) - 2 C(a, b)] / w^2, with C the `mutual_compliance`. Where the width vanishes it is
    [q cosh(q x) cosh(q (L - x)) / sinh(q L) - 1 / L] / T, q = sqrt(T / (E I)): 1 / (2 sqrt(E I T)) away from
    the ends, and infinite for an ideally flexible string.

    Parameters
    ----------
    string
        The string; E I is its `bending_stiffness`.
    position
        The middle of both places, x in m; any shape.
    width
        Distance w of both places, in m, which are strictly inside the string.

    Returns
    -------
    float or array
        In rad/(N m), of the shape of `position`.

    Raises
    ------
    InputError
        If a place is not inside the string.

    Examples
    --------
    >>> plain = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0, core_diameter=2.54e-4)
    >>> round(turning_compliance(plain, 0.08), 3), round(turning_compliance(plain, 0.08, 1e-3), 3)
    (9.625, 6.565)
    """
    if width > 0.0:
        near, far = position - 0.5 * width, position + 0.5 * width
        whole = mutual_compliance(string, near, near) + mutual_compliance(string, far, far)
        return (whole - 2.0 * mutual_compliance(string, near, far)) / width**2  # pyright: ignore[reportReturnType]
    refuse_outside(position, string.length)
    bending = bending_stiffness(string)
    if bending == 0.0:
        return np.full_like(position, np.inf) if np.ndim(position) else np.inf  # pyright: ignore[reportReturnType]
    a = math.sqrt(string.tension / bending)
    # cosh(p) cosh(q) / sinh(p + q), with no exponent above zero.
    both = (1.0 + np.exp(-2.0 * a * position)) * (1.0 + np.exp(-2.0 * a * (string.length - position)))
    result = (-0.5 * a * both / np.expm1(-2.0 * a * string.length) - 1.0 / string.length) / string.tension
    return result if result.ndim else float(result)  # pyright: ignore[reportReturnType]
