"""Base of a driver: screwed to the bar, with nuts for the four height screws."""

from build123d import Compound

from hardware.cad.layout import Driver, Layout
from hardware.cad.shapes import M3, M4, block, nut_pocket, rod

NUT_DEPTH = 6.0
"""Pockets of the height screws' nuts, from below: a 16 mm screw ends 3 mm over the bar and can go 2 lower."""


def build(layout: Layout, driver: Driver) -> Compound:
    """Return the base, centred, on z = 0."""
    half, across, top = driver.base / 2, driver.width / 2, layout.hardware.base_thickness
    body = block((-half, half), (-across, across), (0, top))
    body -= rod(M4["hole"], (-1, top + 1)) + nut_pocket(M4, (top - 4, top + 1))
    for x, y in driver.screws:
        body -= rod(M3["hole"], (-1, top + 1), x, y) + nut_pocket(M3, (-1, NUT_DEPTH), x, y)
    return body
