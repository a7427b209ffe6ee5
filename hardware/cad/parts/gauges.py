"""Gauges to print first: fits, the clearance over a pole, and the places of the coils from a saddle pin."""

from build123d import Compound

from hardware.cad.layout import Layout
from hardware.cad.shapes import M3, M4, block, joined, nut_pocket, rod, rod_across

STEPS = (-0.5, 0.0, 0.5)
"""Steps of the clearance gauge about the design's clearance, in mm."""


def fits(layout: Layout) -> Compound:
    """Return a plate with every fit of the design: pole, magnet, tuner, M3 and M4 nut, and a pin's groove."""
    hardware = layout.hardware
    plate = block((0, 66), (-9, 9), (0, 5))
    plate -= rod(hardware.pole_diameter + hardware.fit, (-1, 6), 7)
    plate -= rod(hardware.magnet_diameter + hardware.fit, (5 - hardware.magnet_height, 6), 17)
    plate -= rod(hardware.tuner_hole, (-1, 6), 30)
    plate -= rod(M3["hole"], (-1, 6), 43) + nut_pocket(M3, (5 - M3["nut_height"], 6), 43)
    plate -= rod(M4["hole"], (-1, 6), 54) + nut_pocket(M4, (5 - M4["nut_height"], 6), 54)
    return plate - rod_across(hardware.pin_diameter + hardware.fit / 2, (-10, 10), x=66, z=5)


def clearance(layout: Layout) -> Compound:
    """Return a stepped strip that goes between a pole and the string: too thin, right, too thick."""
    right = layout.hardware.pole_clearance
    strip = block((0, 24), (-4, 4), (0, 2))
    for index, step in enumerate(STEPS):
        stair = block((23 + 10 * index, 34 + 10 * index), (-4, 4), (0, right + step))
        strip = joined(strip, stair)
    return strip


def places(layout: Layout, end: int) -> Compound:
    """Return a rule that hooks on one saddle pin: notches at the coils, its tip at the range."""
    hardware = layout.hardware
    far = 1e3 * hardware.sensor.range[0] if end == 0 else hardware.length - 1e3 * hardware.sensor.range[1]
    rule = block((-4, far), (3, 15), (0, 3)) - rod(hardware.pin_diameter, (-1, 4), 0, 3)
    for place in hardware.coils[end]:
        x = place if end == 0 else hardware.length - place
        rule -= block((x - 0.5, x + 0.5), (2, 6), (-1, 4))
    return rule
