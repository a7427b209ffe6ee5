"""String support: a block with a saddle pin, and a shelf behind it on which a guitar's tuner sits."""

from build123d import Compound

from hardware.cad.layout import Layout
from hardware.cad.parts.saddle import saddle_block
from hardware.cad.shapes import block, joined, rod


def build(layout: Layout) -> Compound:
    """Return the support as it stands at x = 0, sounding side towards +x, the shelf beyond the bar's end."""
    hardware = layout.hardware
    half, top = hardware.bar_width / 2, hardware.shelf_top
    end = -hardware.post - hardware.tuner_housing / 2 - 6.0
    shelf = block((end, -hardware.back + 1), (-half, half), (top - hardware.shelf_thickness, top))
    hole = rod(hardware.tuner_hole, (top - hardware.shelf_thickness - 1, top + 1), x=-hardware.post)
    return joined(saddle_block(layout), shelf - hole)
