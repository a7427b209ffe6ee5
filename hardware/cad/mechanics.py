"""The mechanics behind the dimensions: saddle, bar, swing, temperature. SI units."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sin, sqrt

import numpy as np

from monochord.core.types import StringParams
from monochord.physics.sensors import Sensor
from monochord.physics.theory import bending_stiffness, decay_rates, open_frequency
from monochord.physics.theory.tension import STRENGTH

EXPANSION = {"steel": 11.7e-6, "stainless": 17.3e-6, "aluminium": 23.0e-6, "PLA": 68.0e-6}
"""Thermal expansion in 1/K; steel and aluminium as the sensor presets have them, others handbook values."""
MODULUS = {"steel": 205e9, "stainless": 193e9, "aluminium": 69e9, "PLA": 3.0e9}
"""Young's modulus in Pa, handbook values; that of printed PLA depends on the print."""
CENTS = 1731.2
"""Cents of a relative change of frequency of one: 1200 / ln 2."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bend:
    """How a frame yields to the string: `deflection` and `approach` of the ends in m, `cents` of pitch.

    `cents` is what a string that was tuned on a rigid frame would lose.
    """

    deflection: float
    approach: float
    cents: float


def stress(string: StringParams) -> float:
    """Return the tensile stress of a string in Pa.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> round(stress(load_string("prototype").string) / 1e6)
    1283
    """
    return 4.0 * string.tension / (pi * string.core_diameter**2)


def elastic_break_angle(string: StringParams) -> float:
    """Return the largest angle over a saddle, in radians, at which no fibre of the wire exceeds its strength.

    A wire under tension T that is bent by theta at a point has its largest curvature there,
    theta / (2 sqrt(EI / T)). Bending adds E d / 2 times it to the tensile stress. Holds for a saddle whose
    radius is smaller than that of the wire.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> round(elastic_break_angle(load_string("prototype").string) * 180 / pi, 1)
    6.1
    """
    room = max(STRENGTH - stress(string), 0.0)
    return (
        4.0
        * sqrt(bending_stiffness(string) / string.tension)
        * room
        / (string.young_modulus * string.core_diameter)
    )


def downforce(string: StringParams, angle: float) -> float:
    """Return the force on a saddle in N: T sin(theta), the string being level on its sounding side."""
    return string.tension * sin(angle)


def cents_per_metre(string: StringParams) -> float:
    """Return by how many cents a string falls where its ends come nearer by 1 m: half of E A / (L T)."""
    stretch = string.young_modulus * pi / 4.0 * string.core_diameter**2 / string.length
    return CENTS / 2.0 * stretch / string.tension


def bar_bend(string: StringParams, *, width: float, thickness: float, height: float, material: str) -> Bend:
    """Return how a bar bends under a string at `height` over its top; all in m.

    The moment T (h + t/2) is the same all along. Its curvature, over E I, bends the bar by L^2 / 8 times it,
    and brings the ends of the string nearer by L (h + t/2) times it.
    """
    arm = height + thickness / 2.0
    modulus = MODULUS[material]
    curvature = string.tension * arm / (modulus * width * thickness**3 / 12.0)
    approach = curvature * arm * string.length
    approach += string.tension * string.length / (modulus * width * thickness)
    return Bend(
        deflection=curvature * string.length**2 / 8.0,
        approach=approach,
        cents=approach * cents_per_metre(string),
    )


def block_lean(string: StringParams, *, width: float, length: float, height: float, material: str) -> float:
    """Return by how much the top of a block leans inwards, in m: a cantilever, T h^3 / (3 E I)."""
    return string.tension * height**3 / (3.0 * MODULUS[material] * width * length**3 / 12.0)


def thermal_cents(string: StringParams, *, frame: str, block: str, offset: float) -> float:
    """Return cents a kelvin for a frame, and blocks that hold their pins `offset` m inside their screws."""
    stretch = string.length * (EXPANSION[frame] - EXPANSION["steel"])
    stretch -= 2.0 * offset * (EXPANSION[block] - EXPANSION[frame])
    return stretch * cents_per_metre(string)


def swing(sensor: Sensor) -> float:
    """Return the largest swing, in m, to which one driver at its limit brings the untouched fundamental.

    A saturated driver pushes with a square wave of F_max at x, whose fundamental is 4 F_max / pi. At
    resonance the mode's amplitude is F sin(pi x / L) / (m 2 sigma omega), with m = mu L / 2 and 1/sigma the
    decay time.
    """
    string = sensor.string
    omega = 2.0 * pi * open_frequency(string)
    sigma = float(decay_rates(string, sensor.losses, np.array([omega / (2.0 * pi)]))[0])
    mass = string.linear_density * string.length / 2.0
    pushes = [each.limit * each.level * sin(pi * each.drive / string.length) for each in sensor.drivers]
    return 4.0 / pi * max(pushes) / (mass * 2.0 * sigma * omega)


def sag(sensor: Sensor, spans: Sequence[tuple[float, float]], force: float = 2.0) -> float:
    """Return how far a press within the sensing range brings the string nearer to what lies below, in m.

    A press F at a makes a triangle of depth F a (L - a) / (T L), T that of the untouched string, which errs
    on the safe side. `spans` are where something lies, from and to in m; a coil's begins and ends at it. The
    worst press is the one nearest to the middle of the string, or to the span.
    """
    string = sensor.string
    length = string.length

    def depth(press: float, place: float) -> float:
        return force * min(press, place) * (length - max(press, place)) / (string.tension * length)

    return max(
        depth(press, min(max(press, start), end))
        for start, end in spans
        for press in (min(max(at, sensor.range[0]), sensor.range[1]) for at in (start, 0.5 * length, end))
    )
