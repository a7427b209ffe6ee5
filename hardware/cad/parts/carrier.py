"""Carrier of two bobbins with their magnets, on four height screws and springs as a guitar's pickup."""

from build123d import Compound

from hardware.cad.layout import Driver, Layout
from hardware.cad.shapes import M3, block, rod

RECESS = 1.0
"""Depth in which the bobbins stand."""


def build(layout: Layout, driver: Driver) -> Compound:
    """Return the carrier, centred, on z = 0."""
    hardware = layout.hardware
    half, across, top = driver.length / 2, driver.width / 2, hardware.carrier_thickness
    body = block((-half, half), (-across, across), (0, top))
    for x in (-driver.spacing / 2, driver.spacing / 2):
        body -= rod(hardware.bobbin_diameter + hardware.fit, (top - RECESS, top + 1), x)
        body -= rod(
            hardware.magnet_diameter + hardware.fit, (top - RECESS - hardware.magnet_height, top + 1), x
        )
    for x, y in driver.screws:
        body -= rod(M3["hole"], (-1, top + 1), x, y)
    return body
