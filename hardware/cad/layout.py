"""Where parts and screws are, in the assembly: one place, so that holes meet. Needs no CAD library."""

from dataclasses import dataclass
from functools import cached_property
from math import tan

from hardware.cad.parameters import Hardware, Millimetres

ADAPTER_SCREW: Millimetres = 22.0
"""From the middle of the bar to each screw of the gripper adapter."""
FOOT_LENGTH: Millimetres = 16.0
FOOT_WIDTH: Millimetres = 60.0
FOOT_ROOM: Millimetres = 10.0
"""From a foot's screw to the base of a driver and to a screw of the adapter, at least."""
EBOW_BASE: Millimetres = 38.0
"""Length of the base below an EBow, whose case and cradle reach over it."""
LOCATING: Millimetres = 3.5
"""From a saddle pin back to the screws that hold its block, so that heat hardly moves the pin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hole:
    """A hole through the bar."""

    x: Millimetres
    y: Millimetres = 0.0
    diameter: Millimetres = 4.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Driver:
    """One driver: its middle on the string, coil spacing, size of carrier and base, y of height screws."""

    x: Millimetres
    spacing: Millimetres
    length: Millimetres
    base: Millimetres
    width: Millimetres
    screw: Millimetres

    @property
    def screws(self) -> tuple[tuple[Millimetres, Millimetres], ...]:
        """Places of the height screws from the middle: one near each corner, so that it tilts no way."""
        along = self.base / 2 - 4.0
        return tuple((x, y) for x in (-along, along) for y in (-self.screw, self.screw))


@dataclass(frozen=True)
class Layout:
    """The places of everything, for the dimensions of one build."""

    hardware: Hardware

    @cached_property
    def drivers(self) -> tuple[Driver, ...]:
        """The drivers, from end 1."""
        return tuple(self._driver(index) for index in range(len(self.hardware.coils)))

    def _driver(self, index: int) -> Driver:
        hardware = self.hardware
        sense, drive = hardware.coils[index]
        middle, spacing = (sense + drive) / 2, abs(sense - drive)
        length = base = spacing + 2 * hardware.edge
        width, screw = hardware.bar_width, hardware.bar_width / 2 - 4.0
        if hardware.driver == "ebow":
            start, end = hardware.faces[index]
            middle, length, base = (start + end) / 2, end - start, min(end - start, EBOW_BASE)
            screw = (hardware.ebow_width or 0.0) / 2 + 3.0 + 4.5
            width = 2 * screw + 7.0
        return Driver(x=middle, spacing=spacing, length=length, base=base, width=width, screw=screw)

    @cached_property
    def block_screws(self) -> tuple[tuple[Millimetres, Millimetres], ...]:
        """Screws of a block at end 1: two that locate it near the pin, two that hold its back down."""
        back = -self.hardware.back + 7.0
        return tuple((x, y) for x in (-LOCATING, back) for y in (-7.0, 7.0))

    @property
    def microphone_screw(self) -> Millimetres:
        """From the middle of the microphone's disc to each screw of its clamp."""
        return self.hardware.piezo_diameter / 2 + 4.0

    @property
    def microphone_place(self) -> tuple[Millimetres, Millimetres]:
        """Of the disc's middle on the side of a block at end 1: x and z."""
        hardware = self.hardware
        return (hardware.front - hardware.back) / 2, hardware.piezo_diameter / 2 + 5.0

    @property
    def microphone_screws(self) -> tuple[tuple[Millimetres, Millimetres], ...]:
        """Screws of a microphone's clamp on a block at end 1: x and z."""
        x, z = self.microphone_place
        return tuple((x + side * self.microphone_screw, z) for side in (-1, 1))

    @property
    def feet(self) -> tuple[Millimetres, ...]:
        """Places of the feet: just inside the drivers' bases, or where these leave no room, outside them."""
        first, last = self.drivers
        inside, outside = (
            (first.x + side * (first.base / 2 + FOOT_ROOM), last.x - side * (last.base / 2 + FOOT_ROOM))
            for side in (1, -1)
        )
        if inside[1] - inside[0] > 2 * (ADAPTER_SCREW + FOOT_ROOM):
            return inside
        return outside if outside[0] - FOOT_LENGTH / 2 > self.hardware.front else ()

    @cached_property
    def holes(self) -> tuple[Hole, ...]:
        """Every hole of the bar."""
        hardware = self.hardware
        ends = [Hole(x=x, y=y) for x, y in self.block_screws]
        other = [Hole(x=hardware.length - x, y=-y) for x, y in self.block_screws]
        drivers = [Hole(x=each.x, diameter=6.5) for each in self.drivers]  # 1 mm to either side
        middle = [Hole(x=hardware.length / 2 + side * ADAPTER_SCREW) for side in (-1, 1)]
        return (*ends, *other, *drivers, *middle, *(Hole(x=x) for x in self.feet))

    def string_at(self, x: Millimetres) -> Millimetres:
        """Return the height of the string behind the saddle of end 1, where it runs down to its fixing."""
        return self.hardware.string_height + tan(self.hardware.break_angle) * min(x, 0.0)
