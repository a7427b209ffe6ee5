"""Screws and nuts in their places, as plain bodies: a hole that misses its screw shows as an overlap."""

from build123d import Compound, Location, Pos, Rot

from hardware.cad.layout import ADAPTER_SCREW, Layout
from hardware.cad.parts import gripper_adapter
from hardware.cad.parts.base import NUT_DEPTH
from hardware.cad.parts.saddle import FLOOR
from hardware.cad.shapes import joined, nut_pocket, rod, turned_about_end

NUT_M3 = {"nut": 5.5}
NUT_M4 = {"nut": 7.0}
HEIGHT_SCREW = 16.0
"""Length of the M3 screws that carry a carrier."""


def screw(diameter: float, length: float) -> Compound:
    """Return a cap screw that points up, its head below z = 0."""
    return joined(rod(diameter, (0, length)), rod(1.75 * diameter, (-diameter, 0)))


def fasteners(layout: Layout, *, stand: str = "feet") -> dict[str, Compound]:
    """Return every screw and nut of the assembly."""
    hardware = layout.hardware
    below, bodies = -hardware.bar_thickness, dict[str, Compound]()
    other, over = turned_about_end(hardware.length), Rot(180, 0, 0)
    for end, turn in ((1, Location()), (2, other)):
        for number, (x, y) in enumerate(layout.block_screws, start=1):
            bodies[f"screw_block_{end}_{number}"] = turn * Pos(x, y, below) * screw(4, 20)
            bodies[f"nut_block_{end}_{number}"] = turn * (
                nut_pocket(NUT_M4, (FLOOR, FLOOR + 3.2), x, y) - rod(4, (0, 20), x, y)
            )
        for number, (x, z) in enumerate(layout.microphone_screws, start=1):
            place = Pos(x, hardware.bar_width / 2 + 5.0, z) * Rot(90, 0, 0)
            bodies[f"screw_microphone_{end}_{number}"] = turn * place * screw(3, 10)
    top = hardware.base_thickness + hardware.spring_gap + hardware.carrier_thickness
    for number, driver in enumerate(layout.drivers, start=1):
        low = hardware.base_thickness - 4.0
        bodies[f"screw_base_{number}"] = Pos(driver.x, 0, below) * screw(4, 16)
        nut = nut_pocket(NUT_M4, (low, low + 3.2), driver.x) - rod(4, (0, 20), driver.x)
        bodies[f"nut_base_{number}"] = nut
        for corner, (along, y) in enumerate(driver.screws):
            x = driver.x + along
            bodies[f"screw_height_{number}_at_{corner}"] = Pos(x, y, top) * over * screw(3, HEIGHT_SCREW)
            nut = nut_pocket(NUT_M3, (NUT_DEPTH - 2.4, NUT_DEPTH), x, y) - rod(3, (0, 20), x, y)
            bodies[f"nut_height_{number}_at_{corner}"] = nut
    if stand == "gripper":
        for side in (-1, 1):
            x = hardware.length / 2 + side * ADAPTER_SCREW
            bodies[f"screw_adapter_{side}"] = Pos(x, 0, 0) * over * screw(4, 20)
            low = below - gripper_adapter.THICKNESS + 0.8
            bodies[f"nut_adapter_{side}"] = nut_pocket(NUT_M4, (low, low + 3.2), x) - rod(4, (-40, 20), x)
        return bodies
    for number, x in enumerate(layout.feet, start=1):
        bodies[f"screw_foot_{number}"] = Pos(x, 0, below - 6.0) * screw(4, 20)
        bodies[f"nut_foot_{number}"] = nut_pocket(NUT_M4, (0, 3.2), x) - rod(4, (-1, 20), x)
    return bodies
