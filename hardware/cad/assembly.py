"""All parts in their places, the bought ones as plain bodies."""

from math import cos, degrees, sin

from build123d import Compound, Location, Pos, Rot

from hardware.cad.fasteners import fasteners
from hardware.cad.layout import Layout
from hardware.cad.parts import (
    anchor,
    bar,
    base,
    bobbin,
    carrier,
    cradle,
    foot,
    gauges,
    gripper_adapter,
    microphone_clamp,
    tuner_support,
)
from hardware.cad.parts.carrier import RECESS
from hardware.cad.shapes import block, joined, rod, rod_across, rod_along, turned_about_end

BOUGHT = ("string", "saddle_pin", "pole", "magnet", "microphone", "ebow", "tuner")
"""First words of the names of bodies that are bought, not made."""


def made(layout: Layout) -> dict[str, Compound]:
    """Return every part to make, once, in its own coordinates, and the gauges."""
    parts = {
        "bar": bar.build(layout),
        "tuner_support": tuner_support.build(layout),
        "anchor": anchor.build(layout),
    }
    for number, driver in enumerate(layout.drivers, start=1):
        parts[f"base_{number}"] = base.build(layout, driver)
        if layout.hardware.driver == "ebow":
            parts[f"cradle_{number}"] = cradle.build(layout, driver)
        else:
            parts[f"carrier_{number}"] = carrier.build(layout, driver)
    if layout.hardware.driver == "coil":
        parts["bobbin"] = bobbin.build(layout)
    parts["microphone_clamp"] = microphone_clamp.build(layout)
    parts["gripper_adapter"] = gripper_adapter.build(layout)
    parts["foot"] = foot.build(layout)
    parts["gauge_fits"], parts["gauge_clearance"] = gauges.fits(layout), gauges.clearance(layout)
    parts["gauge_places_1"], parts["gauge_places_2"] = gauges.places(layout, 0), gauges.places(layout, 1)
    return parts


def assembled(layout: Layout, parts: dict[str, Compound], *, stand: str = "feet") -> dict[str, Compound]:
    """Return all bodies in their places; `stand` is ``"feet"`` or ``"gripper"``."""
    hardware = layout.hardware
    other = turned_about_end(hardware.length)
    bodies = {"bar": parts["bar"], "tuner_support": parts["tuner_support"], "anchor": other * parts["anchor"]}
    bodies |= string(layout) | {"tuner": tuner(layout)}
    pin = rod_across(hardware.pin_diameter, (-12, 12), z=hardware.pin_height)
    x, z = layout.microphone_place
    at_side = Pos(x, hardware.bar_width / 2, z) * Rot(90, 0, 0)
    disc = rod(hardware.piezo_diameter, (-hardware.piezo_thickness, 0))
    for number, turn in ((1, Location()), (2, other)):
        bodies[f"saddle_pin_{number}"] = turn * pin
        bodies[f"microphone_{number}"] = turn * at_side * disc
        clamp = at_side * Pos(0, 0, -microphone_clamp.THICKNESS) * parts["microphone_clamp"]
        bodies[f"clamp_{number}"] = turn * clamp
    for number, driver in enumerate(layout.drivers, start=1):
        bodies[f"base_{number}"] = Pos(driver.x, 0, 0) * parts[f"base_{number}"]
        low = hardware.base_thickness + hardware.spring_gap
        if hardware.driver == "ebow":
            bodies[f"cradle_{number}"] = Pos(driver.x, 0, low) * parts[f"cradle_{number}"]
            bodies[f"ebow_{number}"] = Pos(driver.x, 0, low) * _ebow(layout)
            continue
        bodies[f"carrier_{number}"] = Pos(driver.x, 0, low) * parts[f"carrier_{number}"]
        top = low + hardware.carrier_thickness - RECESS
        for name, place in zip(("sense", "drive"), hardware.coils[number - 1], strict=True):
            bodies[f"bobbin_{name}_{number}"] = Pos(place, 0, top) * parts["bobbin"]
            bodies[f"pole_{name}_{number}"] = rod(
                hardware.pole_diameter, (top, top + hardware.bobbin_height), place
            )
            bodies[f"magnet_{name}_{number}"] = rod(
                hardware.magnet_diameter, (top - hardware.magnet_height, top), place
            )
    below = -hardware.bar_thickness
    if stand == "gripper":
        place = Pos(hardware.length / 2, 0, below - gripper_adapter.THICKNESS)
        bodies["gripper_adapter"] = place * parts["gripper_adapter"]
        return bodies | fasteners(layout, stand=stand)
    for number, foot_x in enumerate(layout.feet, start=1):
        bodies[f"foot_{number}"] = Pos(foot_x, 0, below - hardware.foot_height) * parts["foot"]
    return bodies | fasteners(layout, stand=stand)


def string(layout: Layout) -> dict[str, Compound]:
    """Return the sounding length, a straight wire over both pins, and what runs down behind each."""
    hardware = layout.hardware
    radius, angle = (hardware.pin_diameter + hardware.wire) / 2, hardware.break_angle
    wire = {"string": rod_along(hardware.wire, (0, hardware.length), z=hardware.string_height)}
    leaves = (-radius * sin(angle), hardware.string_height - radius * (1 - cos(angle)))
    for end, turn, far in (
        (1, Location(), 3.0 - hardware.post),
        (2, turned_about_end(hardware.length), -hardware.back),
    ):
        length = (leaves[0] - far) / cos(angle)
        tail = (
            Pos(leaves[0], 0, leaves[1]) * Rot(0, -degrees(angle), 0) * rod_along(hardware.wire, (-length, 0))
        )
        wire[f"string_tail_{end}"] = turn * tail
    return wire


def tuner(layout: Layout) -> Compound:
    """Return a plain body as large as the tuner: its post, and its gear housing below the shelf."""
    hardware = layout.hardware
    top, x, half = hardware.shelf_top, -hardware.post, hardware.tuner_housing / 2
    below = top - hardware.shelf_thickness
    housing = block((x - half, x + half), (-15, 15), (below - hardware.tuner_depth, below))
    return joined(housing, rod(6.0, (below - 1, top + hardware.tuner_post_height + 4), x))


def _ebow(layout: Layout) -> Compound:
    hardware = layout.hardware
    half, across = (hardware.ebow_length or 0.0) / 2, (hardware.ebow_width or 0.0) / 2
    low = hardware.carrier_thickness
    return block((-half, half), (-across, across), (low, low + (hardware.ebow_height or 0.0)))
