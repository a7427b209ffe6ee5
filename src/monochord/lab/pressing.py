"""How deep a string is pressed by a force, and with what force it answers a depth: statics in closed form."""

from monochord.core.types import Floats, StringParams
from monochord.core.units import Metres, Newtons
from monochord.physics.theory import geometric_tension, stretch_stiffness


def depth_under(string: StringParams, position: Metres | Floats, force: Newtons | Floats) -> Floats:
    """Return how deep a force presses a string where it acts.

    d = F x (L - x) / (T(F) L), with the tension of the geometric law. Holds for an ideally flexible string at
    rest, firm ends and small slopes; what the object itself gives way, some micrometres, is left out.

    Parameters
    ----------
    string
        The string.
    position
        Where it is pressed, x in m, inside the string; any shape.
    force
        Normal force F in N, 0 or more; broadcast with `position`.

    Returns
    -------
    array
        d in m, below the string at rest.

    Raises
    ------
    InputError
        If a position is not inside the string or a force is negative.

    Examples
    --------
    >>> plain = StringParams(length=0.2, linear_density=4.0e-4, tension=65.0, core_diameter=2.54e-4)
    >>> f"{depth_under(plain, 0.1, 1.0):.3e}"
    '7.657e-04'
    """
    tension = geometric_tension(string, position, force)  # pyright: ignore[reportArgumentType, reportCallIssue]
    return force * position * (string.length - position) / (tension * string.length)  # pyright: ignore[reportReturnType]


def force_at_depth(string: StringParams, position: Metres | Floats, depth: Metres | Floats) -> Floats:
    """Return the force with which a string answers a press to a depth: the inverse of `depth_under`.

    F = T d L / (x (L - x)) with T = T0 + E A d^2 / (2 x (L - x)): the geometric law, which is a plain
    polynomial where the depth is known. It holds where `depth_under` does.

    Parameters
    ----------
    string
        The string.
    position
        Where it is pressed, x in m, inside the string; any shape.
    depth
        d in m below the string at rest, 0 or more; broadcast with `position`.

    Returns
    -------
    array
        F in N.

    Notes
    -----
    Derived here: the cubic of `monochord.physics.theory.geometric_tension` with F put in terms of d.

    Examples
    --------
    >>> plain = StringParams(length=0.2, linear_density=4.0e-4, tension=65.0, core_diameter=2.54e-4)
    >>> f"{force_at_depth(plain, 0.1, 7.657e-4):.3f}"
    '1.000'
    """
    both = position * (string.length - position)
    tension = string.tension + stretch_stiffness(string) * depth**2 / (2.0 * both)
    return tension * depth * string.length / both  # pyright: ignore[reportReturnType]
