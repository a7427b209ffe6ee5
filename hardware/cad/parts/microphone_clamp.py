"""Clamp that presses the disc of a contact microphone, with a foam pad, on the side of a block."""

from build123d import Compound

from hardware.cad.layout import Layout
from hardware.cad.shapes import M3, block, rod

THICKNESS = 5.0
FOAM = 1.5
"""Of the pad between disc and clamp, pressed."""


def build(layout: Layout) -> Compound:
    """Return the clamp lying on its back, the recess of the disc upwards."""
    hardware = layout.hardware
    half = hardware.block_length / 2
    across = hardware.piezo_diameter / 2 + 2.0
    body = block((-half, half), (-across, across), (0, THICKNESS))
    depth = hardware.piezo_thickness + FOAM
    body -= rod(hardware.piezo_diameter + 2 * hardware.fit, (THICKNESS - depth, THICKNESS + 1))
    body -= block((-2, 2), (-across - 1, 0), (THICKNESS - depth, THICKNESS + 1))  # the way out for the wire
    for x in (-layout.microphone_screw, layout.microphone_screw):
        body -= rod(M3["hole"], (-1, THICKNESS + 1), x)
    return body
