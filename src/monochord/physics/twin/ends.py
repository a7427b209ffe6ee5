"""The string's ends: how they yield, and what of a touch's force the modes of the bank bring to them.

An end of the mechanical admittance Y moves at the velocity Y f under a force f. Where motion is exp(i w t),
the wave numbers k = w / c of a string between two such ends satisfy

    k L + phi_1 + phi_2 = n pi,   tan phi = -i Z Y(w),   Z = sqrt(T mu),

so that Y shifts each mode by i T Y / L in first order of Z Y: its real part adds to the decay rate, and a
spring's, i w C, lowers every partial of every segment as T C more of string would. That part is computed as
such; a resonance shifts the modes of the whole string one by one.
"""

from dataclasses import replace
from math import pi

import numpy as np

from monochord.core.types import Floats, StringParams
from monochord.core.units import Metres
from monochord.physics.setup import End, Sensor
from monochord.physics.theory import bending_stiffness
from monochord.physics.twin.records import OMEGA2_BENDING, OMEGA2_TENSION, TABLE_PLACES

NEAREST = 0.02
"""How near to an end of the string a touch comes, as a share of its length."""


def lengthened(sensor: Sensor) -> Sensor:
    """Return the sensor that the scheme computes: rigid ends, between which the string is longer.

    An end with the compliance C lies where the string would be at rest, T C beyond the real one. All places
    count from there; `offset_of` says by how much they moved.
    """
    near, far = (sensor.string.tension * end.compliance for end in sensor.ends)
    if near == 0.0 and far == 0.0:
        return sensor
    drivers = [replace(d, sense=d.sense + near, drive=d.drive + near) for d in sensor.drivers]
    return replace(
        sensor,
        string=replace(sensor.string, length=sensor.string.length + near + far),
        drivers=(drivers[0], drivers[1]),
    )


def offset_of(sensor: Sensor) -> Metres:
    """Return how far before pickup 1 the scheme's string begins."""
    return sensor.string.tension * sensor.ends[0].compliance


def reach(longer: Sensor, width: Metres = 0.0) -> tuple[Metres, Metres]:
    """Return the first and last place, from pickup 1, of a touch of this width on a `lengthened` sensor."""
    length, offset = longer.string.length, offset_of(longer)
    edge = NEAREST * length + 0.5 * width
    return edge - offset, length - edge - offset


def end_shifts(string: StringParams, end: End, omega: Floats) -> np.ndarray:
    """Return by how much an end's resonance shifts modes, i T Y(w) / L in first order, in rad/s.

    The real part adds to the angular frequency, the imaginary one to the decay rate.
    """
    detuning = omega / (2.0 * pi * end.frequency)
    admittance = end.admittance / (1.0 + 1j * end.quality * (detuning - 1.0 / detuning))
    return 1j * string.tension * admittance / string.length


def residual_shares(sensor: Sensor, bank: Floats, weights: Floats) -> Floats:
    """Return what a newton at each place brings to both ends beside the bank's modes, (touches, 2, places).

    A force at x rests on the ends by 1 - x/L and x/L; the modes of the bank bring part of that at rest.
    """
    shares = np.zeros((len(weights), 2, TABLE_PLACES))
    if not sensor.pickups.residual:
        return shares
    string, half = sensor.string, weights.shape[1]
    place = np.linspace(0.0, 1.0, TABLE_PLACES)
    n = np.arange(1, half + 1)
    wave = n * pi / string.length
    square = string.tension * bank[OMEGA2_TENSION, :half] + bank[OMEGA2_BENDING, :half]
    end = (string.tension + bending_stiffness(string) * wave**2) * wave
    moved = np.divide(end, square, out=np.zeros(half), where=square > 0.0)
    moved *= 2.0 / (string.linear_density * string.length)
    shape = np.sin(np.outer(place, n) * pi)
    for t, weight in enumerate(weights):
        shares[t, 0] = 1.0 - place - shape @ (moved * weight)
        shares[t, 1] = place + shape @ (moved * weight * np.cos(n * pi))
    return shares
