"""The surface of a touching object against a string: its stiffness, its width, and how it resists turning."""

from monochord.core.types import StringParams
from monochord.core.units import Metres, Newtons
from monochord.physics.setup import Touch
from monochord.physics.theory import (
    contact_width,
    edge_distance,
    hertz_stiffness,
    line_stiffness,
    turning_stiffness,
)

LAW_FORCE: Newtons = 1.0
"""Press at which the width of a touch, the exponent of its law and how it resists turning are taken."""
MAX_ARM_RISE = 10.0
"""Largest rise of a round object's arm by the string's own curvature: beyond, the string wraps it."""


def surface_of(string: StringParams, touch: Touch) -> tuple[float, float, Metres]:
    """Return k1 in N/m and k2 in N/m^1.5 of a touch, and the length of string on which it presses, in m."""
    material, law = touch.material, touch.law
    elastic = material.young_modulus, material.poisson_ratio
    if law.flat is not None:
        return line_stiffness(string, law.flat, *elastic), 0.0, law.flat
    radius = touch.radius if touch.radius is not None else material.radius
    k2 = hertz_stiffness(string, radius, *elastic)
    width = float(contact_width(string, radius, *elastic, LAW_FORCE))
    linear = 3.0 - 2.0 * law.exponent  # the share of k1 in the force at LAW_FORCE
    return linear * LAW_FORCE ** (1.0 / 3.0) * k2 ** (2.0 / 3.0), (1.0 - linear) * k2, width


def edges_of(string: StringParams, touch: Touch) -> Metres:
    """Return the distance in m between the two edges on which a touch holds the string; zero for a point."""
    law = touch.law
    if law.width == 0.0:
        return 0.0
    k1, k2, _ = surface_of(string, touch)
    s = (LAW_FORCE / (k1 + k2)) ** 0.5
    compliance = 1.0 / (k1 + 1.5 * k2 * s) + law.layer / (law.layer_load + LAW_FORCE)
    return edge_distance(string, law.width, 1.0 / compliance)


def arm_of(string: StringParams, touch: Touch) -> Metres:
    """Return the moment of a touch over its force and the string's turn, in m."""
    arm = touch.law.arm
    if arm == 0.0:
        return 0.0
    return min(MAX_ARM_RISE * arm, float(turning_stiffness(string, arm, LAW_FORCE)) / LAW_FORCE)
