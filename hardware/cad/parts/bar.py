"""The frame: a flat bar with plain drilled holes. Plain steel drifts with the string, so the pitch stays."""

from build123d import Compound

from hardware.cad.layout import Layout
from hardware.cad.shapes import block, rod


def build(layout: Layout) -> Compound:
    """Return the bar, its top at z = 0 and the crest of the first saddle at x = 0."""
    hardware = layout.hardware
    half = hardware.bar_width / 2
    bar = block(
        (-hardware.back, hardware.length + hardware.back), (-half, half), (-hardware.bar_thickness, 0)
    )
    for hole in layout.holes:
        bar -= rod(hole.diameter, (-hardware.bar_thickness - 1, 1), hole.x, hole.y)
    return bar
