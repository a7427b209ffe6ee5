"""Every dimension of the hardware, in mm, from a sensor preset. x runs along the string, z up from the bar.

A dimension of a bought part that no source gives is in `UNMEASURED`, with how to measure it. The EBow's have
no value until a person gives one; the others have an assumed value, which the command reports.
"""

from dataclasses import dataclass, fields, replace
from math import tan
from typing import TypeAlias

from hardware.cad.mechanics import elastic_break_angle, sag, swing
from monochord.core.errors import InputError
from monochord.physics.sensors import Sensor, load_sensor

Millimetres: TypeAlias = float
UNMEASURED = {
    "tuner_hole": "calipers across the tuner's bushing, plus 0.2 mm",
    "tuner_post_height": "from the headstock's face to the string hole of the tuner's post",
    "tuner_housing": "width of the tuner's gear housing along the string",
    "tuner_depth": "thickness of the gear housing, from the headstock's back down",
    "ball_diameter": "calipers across the ball at the end of the string",
    "piezo_diameter": "calipers across the disc of the contact microphone",
    "piezo_thickness": "calipers across the disc, solder and wire not included",
    "insert_hole": "from the data sheet of the M3 heat-set insert: the hole that it is pressed into",
    "gripper_pitch_along": "between the finger's screw holes along the string, centre to centre",
    "gripper_pitch_across": "between the finger's screw holes across the string, centre to centre",
    "gripper_hole": "diameter of the screws of the gripper's finger, plus 0.3 mm",
    "ebow_length": "calipers along the EBow's case, on the axis through both coils",
    "ebow_width": "calipers across the case at its widest",
    "ebow_height": "from the back of the case to the face that meets the string",
    "ebow_coil_spacing": "slide a paper clip over the face and mark both places of strongest pull",
    "ebow_end_to_sense": "from the end of the case near the sense coil to that coil's mark",
}
"""Dimensions that no source gives, each with how to measure it."""
EBOW = tuple(name for name in UNMEASURED if name.startswith("ebow_"))
PLACE_TOLERANCE: Millimetres = 0.5
"""How far a coil may be off its place: the standard deviation `places` of a twin's `Tolerances`."""
SPAN = 4.0
"""A dimension may be set to its usual value times or over this."""
EBOW_SIZES: tuple[Millimetres, Millimetres] = (5.0, 300.0)
MAX_BREAK_ANGLE = 0.25
"""Largest angle over the saddle, in radians: a thin string would allow more than any block has room for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """The dimensions of one build, in mm. The sensor gives the string and the coils' places.

    `driver` is ``"coil"`` (two wound coils at each end) or ``"ebow"``. Fields may be set; what is
    derived is a property.
    """

    sensor: Sensor
    driver: str = "coil"
    bar_width: Millimetres = 25.0
    bar_thickness: Millimetres = 10.0
    block_length_least: Millimetres = 36.0
    front_limit: Millimetres = 6.0
    pin_diameter: Millimetres = 4.0
    shelf_length: Millimetres = 30.0
    shelf_thickness: Millimetres = 12.0
    base_thickness: Millimetres = 8.0
    spring_gap: Millimetres = 5.0
    carrier_thickness: Millimetres = 6.0
    bobbin_height: Millimetres = 12.0
    bobbin_limit: Millimetres = 14.0
    pole_diameter: Millimetres = 4.0
    magnet_diameter: Millimetres = 6.0
    magnet_height: Millimetres = 3.0
    clearance_margin: Millimetres = 0.5
    foot_height: Millimetres = 22.0
    gap: Millimetres = 1.0
    fit: Millimetres = 0.2
    tuner_hole: Millimetres = 10.2
    tuner_post_height: Millimetres = 10.0
    tuner_housing: Millimetres = 16.0
    tuner_depth: Millimetres = 18.0
    ball_diameter: Millimetres = 4.0
    piezo_diameter: Millimetres = 20.0
    piezo_thickness: Millimetres = 0.5
    insert_hole: Millimetres = 4.0
    gripper_pitch_along: Millimetres = 20.0
    gripper_pitch_across: Millimetres = 12.0
    gripper_hole: Millimetres = 4.3
    ebow_length: Millimetres | None = None
    ebow_width: Millimetres | None = None
    ebow_height: Millimetres | None = None
    ebow_coil_spacing: Millimetres | None = None
    ebow_end_to_sense: Millimetres | None = None

    @property
    def length(self) -> Millimetres:
        """Between the crests of the two saddle pins."""
        return 1e3 * self.sensor.string.length

    @property
    def wire(self) -> Millimetres:
        """Diameter of the string's core."""
        return 1e3 * self.sensor.string.core_diameter

    @property
    def coils(self) -> tuple[tuple[Millimetres, Millimetres], ...]:
        """Places of the sense and the drive coil of each driver."""
        return tuple((1e3 * each.sense, 1e3 * each.drive) for each in self.sensor.drivers)

    @property
    def faces(self) -> tuple[tuple[Millimetres, Millimetres], ...]:
        """What the string passes, from and to: the case of each measured EBow, else each coil."""
        length, before = self.ebow_length, self.ebow_end_to_sense
        if self.driver == "coil" or length is None or before is None:
            return tuple((place, place) for pair in self.coils for place in pair)
        return tuple(
            (sense - before, sense - before + length)
            if drive > sense
            else (sense + before - length, sense + before)
            for sense, drive in self.coils
        )

    @property
    def sag(self) -> Millimetres:
        """How far a press of 2 N brings the string nearer to a pole, or to an EBow's case."""
        return 1e3 * sag(self.sensor, [(1e-3 * start, 1e-3 * end) for start, end in self.faces])

    @property
    def pole_clearance(self) -> Millimetres:
        """From a pole to the string at rest: what a press of 2 N and the swing take, and a margin."""
        return self.sag + 1e3 * swing(self.sensor) + self.clearance_margin

    @property
    def bobbin_diameter(self) -> Millimetres:
        """As wide as the closest pair of coils allows."""
        return min(self.bobbin_limit, min(abs(sense - drive) for sense, drive in self.coils) - self.gap)

    @property
    def edge(self) -> Millimetres:
        """From the centre of a coil to the end of its carrier."""
        return self.bobbin_diameter / 2 + 0.8

    @property
    def front(self) -> Millimetres:
        """From the crest of a saddle pin to the front of its block."""
        outermost = min(min(pair) for pair in self.coils)
        innermost = self.length - max(max(pair) for pair in self.coils)
        return min(self.front_limit, min(outermost, innermost) - self.edge - self.gap)

    @property
    def block_length(self) -> Millimetres:
        """Of the blocks at both ends: as long as the clamp of a microphone."""
        return max(self.block_length_least, self.piezo_diameter + 16.0)

    @property
    def driver_height(self) -> Millimetres:
        """From the underside of a carrier to the face that the string passes."""
        if self.driver == "ebow" and self.ebow_height is not None:
            return self.carrier_thickness + self.ebow_height
        return self.carrier_thickness - 1.0 + self.bobbin_height  # the bobbins stand in a recess of 1 mm

    @property
    def string_height(self) -> Millimetres:
        """From the bar's top to the axis of the string."""
        below = self.base_thickness + self.spring_gap + self.driver_height
        return below + self.pole_clearance + self.wire / 2

    @property
    def pin_height(self) -> Millimetres:
        """Of the axis of a saddle pin: its crest carries the string."""
        return self.string_height - self.wire / 2 - self.pin_diameter / 2

    @property
    def break_angle(self) -> float:
        """Over each saddle, in radians: the largest at which the wire's surface stays below its strength."""
        return min(MAX_BREAK_ANGLE, elastic_break_angle(self.sensor.string))

    @property
    def bar_length(self) -> Millimetres:
        """From the back of one block to the back of the other."""
        return self.length + 2 * (self.block_length - self.front)

    @property
    def back(self) -> Millimetres:
        """From the crest of a saddle pin to the back of its block."""
        return self.block_length - self.front

    @property
    def post(self) -> Millimetres:
        """From the crest of the saddle pin to the axis of the tuner's post."""
        return self.back + 6.0 + self.tuner_housing / 2

    @property
    def shelf_top(self) -> Millimetres:
        """Of the seat of the tuner: the string comes down to its post at the break angle."""
        return self.string_height - tan(self.break_angle) * self.post - self.tuner_post_height

    @property
    def assumed(self) -> dict[str, Millimetres]:
        """Unmeasured dimensions that have an assumed value."""
        values = {name: getattr(self, name) for name in UNMEASURED}
        return {name: value for name, value in values.items() if value is not None}


def load_hardware(name: str, driver: str = "coil", **dimensions: Millimetres) -> Hardware:
    """Return the dimensions for a sensor preset, or a sensor's TOML file.

    Examples
    --------
    >>> hardware = load_hardware("prototype")
    >>> hardware.length, hardware.bobbin_diameter, round(hardware.string_height, 3)
    (200.0, 10.0, 31.426)
    """
    known = {each.name for each in fields(Hardware)} - {"sensor", "driver"}
    for each in dimensions.keys() - known:
        raise InputError(f"dimension '{each}'", f"one of {', '.join(sorted(known))}")
    usual = {each.name: each.default for each in fields(Hardware)}
    for each, value in dimensions.items():
        middle = usual[each]
        low, high = (middle / SPAN, middle * SPAN) if isinstance(middle, float) else EBOW_SIZES
        if not low <= value <= high:
            raise InputError(f"{each} = {value:g} mm", f"{low:g} to {high:g} mm")
    hardware = replace(Hardware(sensor=load_sensor(name), driver=driver), **dimensions)
    if hardware.front < hardware.pin_diameter / 2 + 1.2:
        inside = hardware.edge + hardware.gap
        given = f"sensor '{name}' with coils {inside + hardware.front:.1f} mm from an end"
        expected = f"{inside + hardware.pin_diameter / 2 + 1.2:.1f} mm or more"
        raise InputError(given, expected, "move the coils inwards, or make the bobbins smaller")
    return hardware
