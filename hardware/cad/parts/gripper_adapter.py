"""Adapter between the bar and the finger of a gripper. The finger's hole pattern is unmeasured."""

from build123d import Compound

from hardware.cad.layout import ADAPTER_SCREW, Layout
from hardware.cad.shapes import M4, block, nut_pocket, rod

THICKNESS = 10.0
HEAD = 4.5
"""Depth of the pockets for the heads of the gripper's screws."""


def build(layout: Layout) -> Compound:
    """Return the adapter, centred, on z = 0; the bar lies on its top."""
    hardware = layout.hardware
    half = ADAPTER_SCREW + 8.0
    across = max(hardware.bar_width / 2, hardware.gripper_pitch_across / 2 + 6.0)
    body = block((-half, half), (-across, across), (0, THICKNESS))
    for x in (-ADAPTER_SCREW, ADAPTER_SCREW):
        body -= rod(M4["hole"], (-1, THICKNESS + 1), x) + nut_pocket(M4, (-1, M4["nut_height"] + 0.6), x)
    for x in (-hardware.gripper_pitch_along / 2, hardware.gripper_pitch_along / 2):
        for y in (-hardware.gripper_pitch_across / 2, hardware.gripper_pitch_across / 2):
            body -= rod(hardware.gripper_hole, (-1, THICKNESS + 1), x, y)
            body -= rod(2 * hardware.gripper_hole, (THICKNESS - HEAD, THICKNESS + 1), x, y)
    return body
