"""Bobbin of a wound coil, with a hole for its steel pole."""

from build123d import Compound

from hardware.cad.layout import Layout
from hardware.cad.shapes import block, joined, rod

FLANGE = 1.0


def build(layout: Layout) -> Compound:
    """Return the bobbin, its lower flange on z = 0."""
    hardware = layout.hardware
    height, hole = hardware.bobbin_height, hardware.pole_diameter + hardware.fit
    flanges = [rod(hardware.bobbin_diameter, (low, low + FLANGE)) for low in (0.0, height - FLANGE)]
    body = joined(rod(hole + 1.5, (0, height)), *flanges)
    notch = block((-0.4, 0.4), (hole / 2 + 0.75, hardware.bobbin_diameter), (-1, FLANGE + 1))
    return body - rod(hole, (-1, height + 1)) - notch
