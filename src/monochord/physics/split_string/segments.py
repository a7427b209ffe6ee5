"""The segments of a touched string, and the shapes on them."""

from dataclasses import dataclass
from functools import cache
from math import ceil, pi

import numpy as np

from monochord.core.types import Floats
from monochord.core.units import KilogramsPerMetre, Metres, MetresPerSecond
from monochord.physics.split_string.setup import Drive, PluckShape, SplitString
from monochord.physics.theory import damping_under, tension_from_force

GAUSSIAN_EXTENT = 6.5
"""In standard deviations: beyond, a Gaussian is below 1e-9 of its peak, in position or in wavenumber."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A part of the string between two fixed points, with its drivers and pickups.

    Positions are counted from its support at `origin`, in the `direction` +1 or -1 along the string.
    `drivers` and `pickups` are the positions of those with numbers `channels`. `decay_rate` is the factor of
    -y_t in the equation of motion divided by mu, in 1/s: free oscillation falls by e in 2 / decay_rate.
    """

    length: Metres
    origin: Metres
    direction: int
    speed: MetresPerSecond
    linear_density: KilogramsPerMetre
    decay_rate: float
    spacing: Metres
    channels: slice
    drivers: tuple[Metres, ...]
    pickups: tuple[Metres, ...]


def split(setup: SplitString) -> tuple[Segment, ...]:
    """Return the two segments of a touched string, or the single one of an untouched string."""
    string, contact = setup.string, setup.contact
    if contact is None:
        lengths = (string.length,)
        tension = string.tension
    else:
        lengths = (contact.position, string.length - contact.position)
        tension = tension_from_force(string, contact.force, contact.position, setup.tension_law)
    speed = (tension / string.linear_density) ** 0.5
    damping = damping_under(string, contact.force if contact else 0.0)

    def segment(index: int, length: Metres) -> Segment:
        spacing = length / (setup.nodes - 1)
        mass = {"continuous": string.linear_density, "printed": string.linear_density * spacing}
        return Segment(
            length=length,
            origin=index * string.length,
            direction=1 - 2 * index,
            speed=speed,
            linear_density=string.linear_density,
            decay_rate=damping / mass[setup.damping],
            spacing=spacing,
            channels=slice(index, index + 1) if contact else slice(0, 2),
            drivers=places(setup.drive.place, length),
            pickups=places(setup.pickup_place, length),
        )

    def places(fraction: float, length: Metres) -> tuple[Metres, ...]:
        place = fraction * length
        return (place,) if contact else (place, length - place)

    return tuple(segment(index, length) for index, length in enumerate(lengths))


def drive_density(drive: Drive, segment: Segment, place: Metres, at: Floats) -> Floats:
    """Return the force per length in N/m of one driver at full swing, at local positions `at`.

    A g(x) with g a Gaussian of `drive.width`; divided by its integral over the segment ("normalised"), or by
    the node spacing ("printed", where A g is the force on a node). Zero where g is below 1e-9.
    """
    away = np.abs(at - place) / drive.width
    shape = np.where(away < GAUSSIAN_EXTENT, np.exp(-0.5 * away**2), 0.0)
    if drive.profile == "printed":
        return drive.amplitude / segment.spacing * shape
    nodes, weights = support(drive, segment, place)
    integral = weights @ np.exp(-0.5 * ((nodes - place) / drive.width) ** 2)
    return drive.amplitude / integral * shape


def support(drive: Drive, segment: Segment, place: Metres) -> tuple[Floats, Floats]:
    """Return nodes and weights of a quadrature over a driver's range."""
    low = max(0.0, place - GAUSSIAN_EXTENT * drive.width)
    high = min(segment.length, place + GAUSSIAN_EXTENT * drive.width)
    nodes, weights = _gauss_legendre()
    half = (high - low) / 2.0
    return low + half * (nodes + 1.0), half * weights


@cache
def _gauss_legendre() -> tuple[Floats, Floats]:
    return np.polynomial.legendre.leggauss(96)


def gaussian_modes(width: Metres, length: Metres) -> int:
    """Return how many modes of a segment of `length` a Gaussian of standard deviation `width` excites."""
    return max(1, ceil(GAUSSIAN_EXTENT * length / (pi * width)))


def pluck_amplitudes(pluck: PluckShape, segment: Segment, count: int) -> Floats:
    """Return the modal amplitudes (count,) in m of a plucked segment, of mode 1 upward.

    a_n = 2 h sin(n pi p) / (n^2 pi^2 p (1 - p)) exp(-(n pi w / L)^2 / 2): a triangle with its tip at p L,
    rounded by a Gaussian of width w; y(x) = sum of a_n sin(n pi x / L).
    """
    n = np.arange(1, count + 1)
    triangle = 2.0 * pluck.height * np.sin(n * pi * pluck.place)
    triangle /= (n * pi) ** 2 * pluck.place * (1.0 - pluck.place)
    return triangle * np.exp(-0.5 * (n * pi * pluck.width / segment.length) ** 2)
