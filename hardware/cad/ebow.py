"""Do two stock EBows fit a sensor? What geometry says, for the dimensions that a person measures."""

from dataclasses import dataclass

from hardware.cad.parameters import EBOW, PLACE_TOLERANCE, UNMEASURED, Hardware, Millimetres
from monochord.core.errors import InputError

BATTERY: tuple[Millimetres, Millimetres] = (46.5, 48.5)
"""Least and largest length of the 9 V battery inside every EBow (6LR61 of IEC 60086-2)."""
REMEDY = "take the preset prototype_ebow, or move the preset's drivers to your EBow's coils"
TOUCH: Millimetres = 5.0
"""Half the width of the object that must reach the ends of the sensing range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """The room for the case of each of two equal EBows along the string, in mm.

    `before` is that before the sense coil and `after` that behind the drive coil, seen in the direction from
    sense to drive; `spacings` are those of the coils in the preset, and `spacing` the one value
    that puts every coil as near its place as one part in both places can.
    """

    spacings: tuple[Millimetres, ...]
    spacing: Millimetres
    before: Millimetres
    after: Millimetres

    @property
    def off(self) -> Millimetres:
        """How far each coil stands off its place with the best spacing."""
        return (max(self.spacings) - min(self.spacings)) / 4

    @property
    def length(self) -> Millimetres:
        """The longest case that fits."""
        return self.before + self.spacing + self.after


def room_below(hardware: Hardware) -> Room:
    """Return the room below the string, between the blocks, where nothing stands in a touch's way."""
    inner = hardware.front + hardware.gap
    return _room(hardware, inner, inner, outwards=True)


def room_above(hardware: Hardware) -> Room:
    """Return the room above the string, beyond the sensing range; the case may reach over a block."""
    start, end = (1e3 * each for each in hardware.sensor.range)
    return _room(hardware, start - TOUCH, hardware.length - end - TOUCH, outwards=False)


def _room(hardware: Hardware, first: Millimetres, last: Millimetres, *, outwards: bool) -> Room:
    """Return what walls `first` from end 1 and `last` from end 2 leave, outwards or inwards."""
    spacings = tuple(abs(sense - drive) for sense, drive in hardware.coils)
    limits: dict[str, list[Millimetres]] = {"before": [], "after": []}
    middles = sum(sum(pair) for pair in hardware.coils) / 4
    for index, (sense, drive) in enumerate(hardware.coils):
        wall = first if index == 0 else hardware.length - last
        low, high = min(sense, drive), max(sense, drive)
        middle = middles + (hardware.gap / 2 if index else -hardware.gap / 2)
        outer, inner = (low - wall, middle - high) if index == 0 else (wall - high, low - middle)
        if not outwards:
            outer, inner = hardware.length, (wall - high if index == 0 else low - wall)
        sense_is_outer = (sense < drive) == (index == 0)
        limits["before"].append(outer if sense_is_outer else inner)
        limits["after"].append(inner if sense_is_outer else outer)
    spacing = (max(spacings) + min(spacings)) / 2
    return Room(spacings=spacings, spacing=spacing, before=min(limits["before"]), after=min(limits["after"]))


def refuse_ebows_that_do_not_fit(hardware: Hardware) -> None:
    """Raise an `InputError` unless two EBows, as measured, fit below the string of a sensor."""
    for name in EBOW:
        if getattr(hardware, name) is None:
            raise InputError(
                f"{name} (not measured)", "a length in mm", f"measure it: {UNMEASURED[name]}; then --set"
            )
    room = room_below(hardware)
    spacing, length = hardware.ebow_coil_spacing or 0.0, hardware.ebow_length or 0.0
    before = hardware.ebow_end_to_sense or 0.0
    off = max(abs(each - spacing) for each in room.spacings) / 2
    if off > PLACE_TOLERANCE:
        wanted = " and ".join(f"{each:g}" for each in room.spacings)
        expected = f"{wanted} mm, each coil within {PLACE_TOLERANCE:g} mm of its place"
        raise InputError(f"EBow coils {spacing:g} mm apart", expected, REMEDY)
    if before > room.before or length - before - spacing > room.after:
        expected = (
            f"at most {room.before:.1f} mm before the sense coil and {room.after:.1f} behind the drive coil"
        )
        raise InputError(f"an EBow of {length:g} mm", expected, REMEDY)
