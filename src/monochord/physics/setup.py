"""What a twin is given: the sensor as built, with its tolerances, and the scene around it."""

from dataclasses import dataclass, field, replace
from math import inf, pi
from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.notebook import lines
from monochord.core.ranges import Checked, Finite, Pair, Share
from monochord.core.types import Audio, StringParams
from monochord.core.units import FINITE, Hertz, Metres, MetresPerSecond, Newtons, Seconds
from monochord.physics.materials import Material
from monochord.physics.theory import Losses, TensionLaw

MAX_TOUCHES = 8
"""Objects that may touch the string at once."""
MAX_MOUNT_MODES = 3
"""Modes of object, gripper and frame under a touch."""
DISTORTION_LEVEL = 0.5
"""Amplitude of a sine, in full scale, at which distortion is stated."""
HUM_SHARES = (1.0, 0.25, 0.5, 0.1, 0.3)
"""Amplitudes of the mains' harmonics, from the first, relative to it (assumed)."""
MAX_END_SHARE = 0.02
"""Largest admittance of an end times the string's impedance; the first order leaves out its square."""
MountKind: TypeAlias = Literal["", "bolted", "light", "soft"]
"""Class of a mount; empty for one that is not drawn."""
Spread: TypeAlias = Annotated[float, Meta(ge=0.0, le=0.3)]
"""A relative standard deviation."""
Small: TypeAlias = Annotated[Metres, Meta(ge=0.0, le=0.005)]
"""A standard deviation of a position or length, in m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ebow(Checked):
    """A driver: coils at `sense` and `drive` on the string, each `aperture` wide.

    The aperture is the standard deviation of a Gaussian. Its band has the centre `centre` and quality
    `quality`; `gain` in N s/m is that of a small velocity in its band, `limit` in N its largest force.
    `angle` is between its pull and the direction in which touches press, in radians.

    Off by default: `level` multiplies gain and limit, as another EBow does or another height over the string.
    `bias` b shifts its saturation to F_max (tanh(x + b) - tanh b) / (1 - tanh^2 b), which sounds even
    harmonics: the pull on a magnetised string goes with the square of the flux. `pull` is the negative
    stiffness of its magnet at the drive coil, in N/m, along its angle: it lowers one polarisation's pitch.
    """

    sense: Finite[Metres]
    drive: Finite[Metres]
    aperture: Annotated[Metres, Meta(ge=0.0, le=0.05)] = 4.0e-3
    centre: Annotated[Hertz, Meta(ge=20.0, le=12000.0)] = 1500.0
    quality: Annotated[float, Meta(ge=0.1, le=20.0)] = 0.5
    gain: Annotated[float, Meta(ge=-10.0, le=10.0)] = 0.01
    limit: Annotated[Newtons, Meta(ge=0.0, le=1.0)] = 0.01
    angle: Annotated[float, Meta(ge=-pi, le=pi)] = 0.2
    level: Annotated[float, Meta(ge=0.05, le=20.0)] = 1.0
    bias: Annotated[float, Meta(ge=-1.0, le=1.0)] = 0.0
    pull: Annotated[float, Meta(ge=0.0, le=500.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Pickups(Checked):
    """Two contact microphones at the string's ends and what follows them.

    `own` is l1 and l2 of the paper's Eq. 5; `gain` in full scale a newton; `angle` is the direction in which
    they sense force, from that of a touch's press. The preamplifiers pass `low` to `high`; `hiss` is the
    converter's rms noise in full scale; `air` is the share of an outside sound that each picks up.

    Off by default: `distortion` is the amplitude of the second and of the third harmonic that the stage
    before the converter adds to a sine of amplitude `DISTORTION_LEVEL`, relative to it; 0.001 is -60 dB, and
    the stage clips at 1.2. `hum` is the rms in full scale of each channel's pick-up from the mains, whose
    frequency is `mains` and whose harmonics are `HUM_SHARES`. `feed` is what a driver's coil induces in the
    pickup at its own end and in the other, in full scale a newton of its drive. `residual` adds to the end
    forces the static share of the modes beyond the bank, some 3 % of a touch's force.
    """

    own: Pair[Share] = (0.85, 0.85)
    gain: Pair[Annotated[float, Meta(ge=0.0, le=1e4)]] = (0.5, 0.5)
    angle: Annotated[float, Meta(ge=-pi, le=pi)] = 0.5
    low: Annotated[Hertz, Meta(ge=1.0, le=1000.0)] = 40.0
    high: Annotated[Hertz, Meta(ge=1000.0, le=20000.0)] = 15000.0
    hiss: Annotated[float, Meta(ge=0.0, le=0.1)] = 3.0e-5
    air: Pair[Finite[float]] = (1.0, 0.9)
    distortion: Pair[Annotated[float, Meta(ge=-0.01, le=0.01)]] = (0.0, 0.0)
    hum: Pair[Annotated[float, Meta(ge=0.0, le=0.1)]] = (0.0, 0.0)
    mains: Annotated[Hertz, Meta(ge=45.0, le=65.0)] = 50.0
    feed: Pair[Annotated[float, Meta(ge=-1e3, le=1e3)]] = (0.0, 0.0)
    residual: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class End(Checked):
    """How an end of the string yields, across the string in both directions; rigid by default.

    Its admittance, velocity over force, is i w C + A / (1 + i Q (w / w0 - w0 / w)): a spring of `compliance`
    C in m/N, as a tuner or a saddle is far below its resonances, and one resonance of the frame, with A, its
    `admittance` in s/kg, `frequency` and `quality`. The spring lengthens the string by T C at this end, for
    every touch; the resonance changes frequency and decay of each mode of the whole string, in first order.
    """

    compliance: Annotated[float, Meta(ge=0.0, le=2e-5)] = 0.0
    admittance: Annotated[float, Meta(ge=0.0, le=0.05)] = 0.0
    frequency: Annotated[Hertz, Meta(ge=20.0, le=12000.0)] = 1000.0
    quality: Annotated[float, Meta(ge=0.1, le=100.0)] = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances(Checked):
    """How another sensor of the same design differs: standard deviations, assumed unless a source is named.

    The wire: `diameter` is relative; ASTM A228 allows 0.3 thousandths of an inch on a music wire of .010, 3 %
    or three of these deviations. `tuning` is the tuning error, by ear or meter, in cents. `length` is that
    between the ends, `places` that of each of the four coils, `aperture` a coil's effective width.

    The drivers: `gain`, `limit`, `centre` and `quality` are relative, of coils wound, glued and set at a
    height by hand; `tilt` is that of drivers and pickups about the string, in radians. The pickups:
    `pickup_gain` is relative, 0.12 being a decibel of piezo and preamplifier; `own` is that of l1 and l2,
    absolute, which depend on how the frame is mounted. `losses` is relative, of each loss factor.
    """

    diameter: Spread = 0.01
    tuning: Annotated[float, Meta(ge=0.0, le=100.0)] = 10.0
    length: Small = 2.5e-4
    places: Small = 5.0e-4
    aperture: Spread = 0.05
    gain: Spread = 0.10
    limit: Spread = 0.10
    centre: Spread = 0.05
    quality: Spread = 0.05
    tilt: Annotated[float, Meta(ge=0.0, le=0.3)] = 0.05
    pickup_gain: Spread = 0.12
    own: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.03
    losses: Spread = 0.20


@dataclass(frozen=True, slots=True, kw_only=True)
class Changes(Checked):
    """How the same sensor differs on another day: standard deviations, assumed.

    `temperature` is the change of frame and string together since tuning, in K, in a room in daily use.
    `creep` is the tension that string and tuner have lost since, in N. `warming` is the rate of the
    temperature within a session, in K an hour. `gain` and `limit` are relative: a battery, and the height of
    an EBow that was put back; `pickup_gain` is relative, 0.035 being 0.3 dB: knobs set again by their marks.
    """

    temperature: Annotated[float, Meta(ge=0.0, le=30.0)] = 3.0
    creep: Annotated[Newtons, Meta(ge=0.0, le=5.0)] = 0.05
    warming: Annotated[float, Meta(ge=0.0, le=60.0)] = 1.5
    gain: Spread = 0.05
    limit: Spread = 0.05
    pickup_gain: Spread = 0.035


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor(Checked):
    """A sensor as built: string, losses, two drivers, two pickups, and its sensing range.

    `ends` say how the string's ends yield. `drift` is the deviation of the string's tension from its nominal
    value at the start, in N, and `drift_rate` its rate in N/s, up to a quarter of the tension in all. `shake`
    is the acceleration of the frame, in m/s^2, that an outside sound of full scale causes. `press_tension` is
    what a newton of press adds to the tension beside the geometric law, in N/N. `measured_length` is the
    string's length in m as a ruler gave it to whoever built the sensor, if it was drawn.

    `frame_expansion` and `string_expansion` are relative, in 1/K: handbook values of aluminium and of steel.
    `tolerances` say how another sensor of the design may differ and `changes` how this one does on another
    day; `monochord.physics.twin.variation` draws them.
    """

    name: str
    string: StringParams
    drivers: tuple[Ebow, Ebow]
    range: Pair[Finite[Metres]]
    title: str = ""
    source: str = ""
    notes: str = ""
    losses: Losses = field(default_factory=Losses)
    pickups: Pickups = field(default_factory=Pickups)
    ends: tuple[End, End] = field(default_factory=lambda: (End(), End()))
    drift: Annotated[Newtons, Meta(ge=-50.0, le=50.0)] = 0.0
    drift_rate: Annotated[float, Meta(ge=-1.0, le=1.0)] = 0.0
    shake: Annotated[float, Meta(ge=0.0, le=100.0)] = 2.0
    press_tension: Annotated[float, Meta(ge=0.0, le=20.0)] = 0.0
    measured_length: Annotated[Metres, Meta(gt=0.0)] | None = None
    frame_expansion: Annotated[float, Meta(ge=0.0, le=1e-4)] = 23.0e-6
    string_expansion: Annotated[float, Meta(ge=0.0, le=1e-4)] = 11.7e-6
    tolerances: Tolerances = field(default_factory=Tolerances)
    changes: Changes = field(default_factory=Changes)

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        refuse_impossible(self)

    def __repr__(self) -> str:
        string, (low, high) = self.string, (1e3 * end for end in self.range)
        measured = "" if self.measured_length is None else f"{1e3 * self.measured_length:.1f} mm"
        return lines(
            f"Sensor: {self.name}",
            [
                ("string", f"{1e3 * string.length:.4g} mm at {string.tension:.3g} N"),
                ("senses", f"{low:g} to {high:g} mm"),
                ("measured length", measured),
                ("title", self.title),
            ],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Key(Checked):
    """What a touch does at a time: where it is, and how hard it presses or how far off it is.

    `force` is the normal force that a string at rest would press back with, `clearance` the distance of the
    surface from the string at rest, `across` the object's speed across the string.
    """

    time: Finite[Seconds]
    position: Finite[Metres]
    force: Annotated[Newtons, Meta(ge=0.0, le=10.0)] = 0.0
    clearance: Annotated[Metres, Meta(ge=0.0, le=0.1)] = 0.0
    across: Annotated[MetresPerSecond, Meta(ge=-0.5, le=0.5)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MountMode(Checked):
    """A mode of a held object, its gripper and the frame, seen from the point of contact.

    `mass` is the modal mass in kg, `quality` is Q. A robot's hand and tool have them from some hundred Hz on;
    the usual values are assumed.
    """

    mass: Annotated[float, Meta(ge=1e-4, le=1.0)] = 0.01
    frequency: Annotated[Hertz, Meta(ge=20.0, le=8000.0)] = 1000.0
    quality: Annotated[float, Meta(ge=1.0, le=FINITE)] = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Mount(Checked):
    """How a touching object gives way to the string: up to three modes, and a spring for all that is faster.

    `compliance` is the spring's, in m/N: 1e-5 is 1e5 N/m. By default the object is held rigidly. Modes give
    way in the direction of the press, the spring under friction too. The force that the object's motion
    prescribes stays what it is at rest. `kind` is the class that it was drawn from, if it was.
    """

    modes: tuple[MountMode, ...] = ()
    compliance: Annotated[float, Meta(ge=0.0, le=1e-3)] = 0.0
    kind: MountKind = ""

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if len(self.modes) > MAX_MOUNT_MODES:
            raise InputError(f"a mount of {len(self.modes)} modes", f"{MAX_MOUNT_MODES} at most")


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactLaw(Checked):
    """How an object's surface resists the string; by default as Hertz's smooth, round contact.

    `exponent` is the slope of log f over log delta under a press of 1 N, where the compression is Hertz's:
    the law is k1 delta + k2 delta^(3/2), 1 below and 3/2 above. Layers of a print, a coat of paint or a
    worn edge lower it. `flat` is the length of string in m under a flat object, whose law is linear (`radius`
    and `exponent` then count for nothing); a sharp edge is a touch of small `radius`.

    A rough surface is a layer in series that closes by u = u0 log(1 + f / F0): `layer` is u0 in m, about 0.4
    of the rms height, and `layer_load` F0 in N, below which but a few asperities touch (assumed).

    Off by default: `width` in m is that between two edges on which the string lies, each with half of the
    contact, which shortens both segments and resists turning; `arm` in m is the moment by which a contact
    resists turning, over force and turn: the radius of a round object, which rolls. See
    `monochord.physics.twin.turning`.

    References
    ----------
    Persson (2007), Relation between interfacial separation and load: a general theory of contact mechanics,
    Phys. Rev. Lett. 99, 125502, for u0; Pastewka et al. (2013), Finite-size scaling in the interfacial
    stiffness of rough elastic contacts, Phys. Rev. E 87, 062809, for small loads.
    """

    exponent: Annotated[float, Meta(ge=1.0, le=1.5)] = 1.5
    flat: Annotated[Metres, Meta(ge=2e-4, le=1e-2)] | None = None
    layer: Annotated[Metres, Meta(ge=0.0, le=1e-4)] = 0.0
    layer_load: Annotated[Newtons, Meta(ge=1e-4, le=1.0)] = 0.01
    width: Annotated[Metres, Meta(ge=0.0, le=1e-2)] = 0.0
    arm: Annotated[Metres, Meta(ge=0.0, le=10.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch(Checked):
    """An object and its motion: linear between keys, constant before the first and after the last.

    `radius` is the object's where it touches, by default its material's. Where the position moves, the object
    rolls along the string or, with `rolls` false, slides. `mount` is how it is held, `law` how its surface
    resists.
    """

    material: Material
    motion: tuple[Key, ...]
    radius: Annotated[Metres, Meta(ge=2e-4, le=1.0)] | None = None
    rolls: bool = True
    mount: Mount = field(default_factory=Mount)
    law: ContactLaw = field(default_factory=ContactLaw)

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if not self.motion:
            raise InputError("a touch without keys", "at least one key", "give time and position")
        for before, after in zip(self.motion, self.motion[1:], strict=False):
            if not after.time > before.time:
                raise InputError(f"key at {after.time:g} s after {before.time:g} s", "rising times")
            speed = abs(after.position - before.position) / (after.time - before.time)
            if speed > 5.0:
                raise InputError(f"a touch that moves at {speed:.3g} m/s", "5 m/s at most along the string")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outside(Checked):
    """A sound from outside: mono, at the twin's rate, repeated endlessly.

    Full scale is that of the converter; `level` multiplies it before it reaches microphones and frame.
    """

    samples: Audio
    level: Annotated[float, Meta(ge=0.0, le=1e3)] = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Pluck(Checked):
    """A start from a triangle of height `height` at `position`, along `angle` from the press direction."""

    position: Finite[Metres]
    height: Annotated[Metres, Meta(ge=-2e-3, le=2e-3)]
    angle: Finite[float] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What happens to a sensor: touches, outside sound, pluck, drivers that are on, and the tension law."""

    touches: tuple[Touch, ...] = ()
    outside: Outside | None = None
    pluck: Pluck | None = None
    drivers: tuple[bool, bool] = (True, True)
    tension_law: TensionLaw = "geometric"

    def __post_init__(self) -> None:
        if len(self.touches) > MAX_TOUCHES:
            raise InputError(f"{len(self.touches)} touches", f"{MAX_TOUCHES} at most")


def hold(position: Metres, force: Newtons, material: Material, *, across: MetresPerSecond = 0.0) -> Touch:
    """Return a touch that presses from the start with constant force.

    Examples
    --------
    >>> from monochord.physics.materials import load_material
    >>> hold(0.08, 1.0, load_material("plastic")).motion[0].force
    1.0
    """
    return Touch(material=material, motion=(Key(time=0.0, position=position, force=force, across=across),))


def lengthened(sensor: Sensor, share: float) -> Sensor:
    """Return a sensor whose string is longer by a factor at the same pitch.

    Coils of the further half stay where they are from the further end. The sensing range stays.

    >>> from monochord.physics.sensors import load_sensor
    >>> sensor = lengthened(load_sensor("prototype"), 1.01)
    >>> round(sensor.string.length, 6), sensor.range
    (0.202, (0.05, 0.15))
    """
    string = sensor.string
    moved = string.length * (share - 1.0)

    def place(x: Metres) -> Metres:
        return x if x < 0.5 * string.length else x + moved

    first, second = (
        replace(driver, sense=place(driver.sense), drive=place(driver.drive)) for driver in sensor.drivers
    )
    longer = replace(string, length=share * string.length, tension=share**2 * string.tension)
    return replace(sensor, string=longer, drivers=(first, second))


def refuse_impossible(sensor: Sensor) -> None:
    """Raise `InputError` for a sensor whose string is implausible or outside what the scheme is made for."""
    string, where = sensor.string, f"sensor {sensor.name}"
    for name, low, high, unit in (
        ("length", 0.05, 2.0, "m"),
        ("linear_density", 1e-5, 0.05, "kg/m"),
        ("tension", 2.0, 500.0, "N"),
        ("core_diameter", 0.0, 3e-3, "m"),
        ("young_modulus", 1e9, 1e12, "Pa"),
        ("tension_per_force", 0.0, 20.0, "N/N"),
    ):
        value = float(getattr(string, name))
        if not low <= value <= high:
            raise InputError(f"{where}: {name} {value:g} {unit}", f"{low:g} to {high:g} {unit}")
    fundamental = (string.tension / string.linear_density) ** 0.5 / (2.0 * string.length)
    if not 20.0 <= fundamental <= 5000.0:
        raise InputError(
            f"{where}: open frequency {fundamental:.4g} Hz",
            "20 to 5000 Hz",
            "change length, tension or density",
        )
    if abs(sensor.drift) > 0.25 * string.tension:
        raise InputError(f"{where}: drift {sensor.drift:g} N", "a quarter of the tension at most")
    places = [place for driver in sensor.drivers for place in (driver.sense, driver.drive)]
    for place in [*places, *sensor.range]:
        if not 0.0 < place < string.length:
            raise InputError(f"{where}: place {place:g} m", f"between 0 and {string.length:g} m")
    _refuse_strong_parts(sensor, where)
    if not sensor.range[0] < sensor.range[1] < inf:
        raise InputError(f"{where}: range {sensor.range}", "start before end")


def _refuse_strong_parts(sensor: Sensor, where: str) -> None:
    """Raise `InputError` for a magnet that the string may stick to, or an end that yields too much to it."""
    string = sensor.string
    for d, driver in enumerate(sensor.drivers):
        most = 0.5 * string.tension * string.length / (driver.drive * (string.length - driver.drive))
        if driver.pull > most:
            given = f"{where}: driver {d + 1} pulls with {driver.pull:g} N/m"
            raise InputError(given, f"{most:.3g} N/m at most", "half of what the string resists with there")
    impedance = (string.tension * string.linear_density) ** 0.5
    for end in sensor.ends:
        if (
            end.admittance * impedance > MAX_END_SHARE
            or end.compliance * string.tension > 0.01 * string.length
        ):
            given = f"{where}: an end of {end.admittance:g} s/kg and {end.compliance:g} m/N"
            raise InputError(given, "one that hardly yields to this string")
