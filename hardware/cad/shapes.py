"""Solids that the parts are made of, placed by their limits. Lengths in mm."""

from math import cos, pi

from build123d import Box, Compound, Cylinder, Location, Pos, RegularPolygon, Rot, extrude

Limits = tuple[float, float]
M3 = {"hole": 3.4, "nut": 5.7, "nut_height": 2.6}
"""Clearance hole, width and height of the pocket for a nut (ISO 4032, with room for a print)."""
M4 = {"hole": 4.5, "nut": 7.3, "nut_height": 3.4}


def block(x: Limits, y: Limits, z: Limits) -> Compound:
    """Return the box between these limits."""
    place = Pos(sum(x) / 2, sum(y) / 2, sum(z) / 2)
    return place * Box(x[1] - x[0], y[1] - y[0], z[1] - z[0])


def rod(diameter: float, z: Limits, x: float = 0.0, y: float = 0.0) -> Compound:
    """Return an upright cylinder."""
    return Pos(x, y, sum(z) / 2) * Cylinder(diameter / 2, z[1] - z[0])


def rod_across(diameter: float, y: Limits, x: float = 0.0, z: float = 0.0) -> Compound:
    """Return a cylinder across the string."""
    return Pos(x, sum(y) / 2, z) * Rot(90, 0, 0) * Cylinder(diameter / 2, y[1] - y[0])


def rod_along(diameter: float, x: Limits, y: float = 0.0, z: float = 0.0) -> Compound:
    """Return a cylinder along the string."""
    return Pos(sum(x) / 2, y, z) * Rot(0, 90, 0) * Cylinder(diameter / 2, x[1] - x[0])


def joined(*bodies: Compound) -> Compound:
    """Return bodies as one."""
    whole = bodies[0]
    for body in bodies[1:]:
        both = whole + body
        assert isinstance(both, Compound)
        whole = both
    return whole


def nut_pocket(screw: dict[str, float], z: Limits, x: float = 0.0, y: float = 0.0) -> Compound:
    """Return the hexagon of a nut's pocket, two faces towards x, so that it slides in along y."""
    corner = screw["nut"] / 2 / cos(pi / 6)
    return Pos(x, y, z[0]) * Rot(0, 0, 30) * extrude(RegularPolygon(corner, 6), z[1] - z[0])


def turned_about_end(length: float) -> Location:
    """Return what brings a part of end 1 to end 2: half a turn about the middle of the string."""
    return Pos(length, 0, 0) * Rot(0, 0, 180)
