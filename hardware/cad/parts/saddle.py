"""The block that both ends share: a groove for the saddle pin, screws below, a face for the microphone."""

from build123d import Compound

from hardware.cad.layout import Layout
from hardware.cad.shapes import M4, block, joined, nut_pocket, rod, rod_across

STEP = 4.0
"""How far the block's top drops behind the pin, so that the string runs free."""
FLOOR = 2.5
"""Below the slots of the nuts."""
INSERT = 7.0
"""Depth of the holes for the threaded inserts of the microphone's clamp."""


def saddle_block(layout: Layout) -> Compound:
    """Return the block at x = 0, its sounding side towards +x, its base on z = 0."""
    hardware = layout.hardware
    half, top = hardware.bar_width / 2, hardware.pin_height
    behind = -hardware.pin_diameter / 2 - 3.0
    body = joined(
        block((behind, hardware.front), (-half, half), (0, top)),
        block((-hardware.back, behind), (-half, half), (0, top - STEP)),
    )
    body -= rod_across(hardware.pin_diameter + hardware.fit / 2, (-half - 1, half + 1), z=top)
    for x, y in layout.block_screws:
        body -= rod(M4["hole"], (-1, FLOOR + M4["nut_height"] + 5.5), x, y)
        body -= nut_pocket(M4, (FLOOR, FLOOR + M4["nut_height"]), x, y)
        outside = (y, half + 1) if y > 0 else (-half - 1, y)
        body -= block((x - M4["nut"] / 2, x + M4["nut"] / 2), outside, (FLOOR, FLOOR + M4["nut_height"]))
    for x, z in layout.microphone_screws:
        body -= rod_across(hardware.insert_hole, (half - INSERT, half + 1), x, z)
    return body
