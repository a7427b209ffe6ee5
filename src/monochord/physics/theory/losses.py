"""How fast each partial of a stiff steel string dies away: air, the wire itself and what holds it."""

from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats, StringParams
from monochord.physics.theory._checks import refuse_not_positive
from monochord.physics.theory.hertz import outer_diameter
from monochord.physics.theory.loaded import bending_stiffness


@dataclass(frozen=True, slots=True, kw_only=True)
class Losses:
    """What takes energy from a vibrating string.

    `air_viscosity` in Pa s and `air_density` in kg/m^3 are those of air in a room. The others have no unit:
    `viscoelastic` is the loss angle of bending, `thermoelastic` the inverse quality factor of the wire at any
    frequency (heat flow and dislocations), `support` that of what holds the ends. The loss angle and the
    wire's factor are of the size found for plain steel strings; the support is assumed, for ends on a
    printed fixture, and bears most of the loss.
    """

    air_viscosity: float = 1.8e-5
    air_density: float = 1.2
    viscoelastic: float = 4.5e-3
    thermoelastic: float = 2.0e-4
    support: float = 1.0e-3

    def __post_init__(self) -> None:
        for name in ("air_viscosity", "air_density", "viscoelastic", "thermoelastic", "support"):
            value: float = getattr(self, name)
            if not 0.0 <= value < np.inf:
                raise InputError(f"{name.replace('_', ' ')} {value:g}", "0 or more, and finite")


def decay_rates(string: StringParams, losses: Losses, frequencies: Floats) -> Floats:
    """Return how fast partials die away: their amplitude falls as exp(-sigma t).

    sigma = pi f / Q, with 1/Q = 1/Q_air + 1/Q_ve + thermoelastic + support and

        1/Q_air = R / (2 pi mu f), R = 2 pi eta + 2 pi d sqrt(pi eta rho f),
        1/Q_ve = 4 pi^2 mu E I delta f^2 / T^2.

    R is Stokes' drag on a thin cylinder, d the `outer_diameter`: that of a solid steel string of the same
    weight. Q_ve holds while bending adds little to the frequency, B n^2 well below one, and is infinite for a
    string of no core diameter. `damping` of the string, one value for all partials, is not counted.

    Parameters
    ----------
    string
        The string.
    losses
        What takes the energy.
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
