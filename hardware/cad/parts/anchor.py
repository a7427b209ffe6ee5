"""End stop: a block with a saddle pin, and a wall that holds the ball end of the string."""

from build123d import Compound

from hardware.cad.layout import Layout
from hardware.cad.parts.saddle import STEP, saddle_block
from hardware.cad.shapes import block, joined, rod_along

WALL = 9.0
"""Thickness of the wall behind which the ball lies."""


def build(layout: Layout) -> Compound:
    """Return the end stop as it stands at x = 0, sounding side towards +x."""
    hardware = layout.hardware
    back, half = -hardware.back, hardware.bar_width / 2
    height = layout.string_at(back + WALL / 2)
    low = hardware.pin_height - STEP - 1
    wall = block((back, back + WALL), (-half, half), (low, hardware.string_height + 2))
    body = joined(saddle_block(layout), wall)
    body -= block((back - 1, back + WALL + 1), (-0.6, 0.6), (height - 0.6, hardware.string_height + 3))
    ball = hardware.ball_diameter + 2 * hardware.fit
    return body - rod_along(ball, (back - 1, back + WALL / 2), z=layout.string_at(back + WALL / 4))
