"""Foot for a bench: high enough that the tuner hangs free."""

from build123d import Compound

from hardware.cad.layout import FOOT_LENGTH, FOOT_WIDTH, Layout
from hardware.cad.shapes import M4, block, rod


def build(layout: Layout) -> Compound:
    """Return the foot, centred, on z = 0; a screw from below goes through the bar into a nut on its top."""
    top = layout.hardware.foot_height
    half, across = FOOT_LENGTH / 2, FOOT_WIDTH / 2
    body = block((-half, half), (-across, across), (0, top))
    body -= rod(M4["hole"], (-1, top + 1)) + rod(8.5, (-1, top - 6))
    return body - block((-half - 1, half + 1), (-8, 8), (-1, 3))  # stands on its two edges
