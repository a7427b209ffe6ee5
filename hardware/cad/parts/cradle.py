"""Cradle of an EBow, on a base and four height screws as the coils' carrier; tape below holds the case."""

from build123d import Compound

from hardware.cad.layout import Driver, Layout
from hardware.cad.shapes import M3, block, joined, rod

WALL = 6.0
"""Height of the walls at the sides of the case."""


def build(layout: Layout, driver: Driver) -> Compound:
    """Return the cradle, centred, on z = 0."""
    hardware = layout.hardware
    half, across, top = driver.length / 2, driver.width / 2, hardware.carrier_thickness
    inside = (hardware.ebow_width or 0.0) / 2 + hardware.fit
    body = block((-half, half), (-across, across), (0, top))
    for side in (-1, 1):
        limits = sorted((side * inside, side * (inside + 3)))
        body = joined(body, block((-half, half), (limits[0], limits[1]), (top - 1, top + WALL)))
    for x, y in driver.screws:
        body -= rod(M3["hole"], (-1, top + 1), x, y)
    return body
