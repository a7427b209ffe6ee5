"""What a string will do as a sensor before it is built: frequencies, bounds, drift, strength, clearance.

Everything is closed form. How well position and force can be told is `contact_bound`, with the open pitch
measured, lines known to `LINE_STD`, ends known to `END_STD`, and contact and mount known only by their class
(`monochord.physics.lengthening`).
"""

from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product
from math import log2, pi, sin, sqrt
from typing import Annotated

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError, did_you_mean
from monochord.core.ranges import Checked
from monochord.core.types import Contact, Floats, StringParams
from monochord.core.units import Hertz, Metres, Newtons, Pascals, Seconds
from monochord.physics.lengthening import MountName, contact_compliance, lengthening
from monochord.physics.materials import Material, load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.setup import Ebow, Sensor
from monochord.physics.theory import (
    Losses,
    contact_bound,
    decay_rates,
    geometric_tension,
    locate_from_segments,
    open_frequency,
    segment_frequencies,
    stretch_stiffness,
    tension_from_segments,
)
from monochord.physics.theory.bounds import frequency_sensitivities
from monochord.physics.theory.tension import STRENGTH

LINE_STD, OPEN_STD, END_STD = 5e-4, 7e-4, 1e-4
"""Relative standard errors of a segment's fundamental and of the open pitch, and that of an end in m."""
CONTACT_SHARE = 0.1
"""Relative standard error of a contact's compliance, of an object that the sensor is calibrated for."""
SNR = 1e3
"""Power ratio of a partial to the noise in its window: 30 dB."""
SAMPLE_RATE: Hertz = 44100.0
MAX_STRESS_SHARE = 0.6
"""Largest stress over the wire's strength, under the hardest press; on instruments it is 0.5 to 0.7."""
CLEARANCE_MARGIN: Metres = 5e-4
"""Beside swing and sag, between string and pole."""
MAX_MODE = 6
"""Highest mode of a segment that a driver is expected to hold."""
SETTLED = 3.0
"""Decay times until a touch has settled: to 5 % of the change."""
GAUGES: tuple[Metres, ...] = tuple(round(25.4e-6 * each, 7) for each in (8, 9, 10, 11, 12, 13, 14, 16))
"""Plain strings that shops sell, in m: .008 to .016."""
TENSIONS: tuple[Newtons, ...] = (15, 20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 75, 85, 95, 110)
COMPARED: tuple[Newtons, ...] = (20.0, 40.0, 65.0)
"""Tensions that every design is compared at."""
COIL_ROOM: Metres = 0.045
"""Least room for a driver's coils beside the range, at either end; the prototype has 50 mm."""
NO_MODEL = "none"
"""In place of a model that is to take the string: a string of any length and pitch will do."""
CENTS = 1200.0 / float(np.log(2.0))
"""Cents of a relative change of frequency of one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wire:
    """A string's material: density in kg/m^3, Young's modulus and strength in Pa, expansion in 1/K."""

    density: float
    modulus: Pascals
    strength: Pascals
    expansion: float


WIRES = {
    "music_wire": Wire(density=7850.0, modulus=2.0e11, strength=STRENGTH, expansion=11.7e-6),
    "stainless": Wire(density=7900.0, modulus=1.85e11, strength=2.2e9, expansion=17.3e-6),
}
"""Plain wires: ASTM A228 and, less magnetic, hard-drawn A313 type 302; handbook values."""
FRAMES = {"steel": 11.7e-6, "stainless": 17.3e-6, "aluminium": 23.0e-6, "carbon": 0.95e-6, "pla": 68.0e-6}
"""Thermal expansion of frames in 1/K, handbook values; carbon's along the fibres of a pultruded tube."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes(Checked):
    """What a sensor is to do.

    Parameters
    ----------
    length
        Room for the string between its ends, in m; shorter strings are tried, too.
    range
        Length to be sensed, in m, in the middle of the string.
    resolution
        Standard error of position wanted at 1 N, in m.
    force_resolution
        Standard error of force wanted at 1 N, in N.
    forces
        Least and largest press, in N.
    gauge
        Diameter of the wire, in m; by default .008 to .016 inch are tried.
    tension
        Tension at rest, in N; by default 15 to 110 N are tried.
    wire, frame
        Materials of the wire and of the frame, by name.
    mount
        How touching objects are held.
    material
        Material that touches, from ``'monochord list materials'``.
    contact_share
        Relative standard error of the contact's compliance: 0.3 for unknown objects.
    line_std
        Relative standard error of a segment's fundamental.
    open_std
        Relative standard error of the open pitch.
    end_std
        Standard error of where each end of the string is, in m.
    window
        Length of a window, in s.
    gap
        Distance from the string at rest to a driver's pole, in m.
    level
        Force of the drivers, relative to the presets'.
    model
        Model that is to take the string, bundled or a folder; ``'none'`` for any string.
    """

    length: Annotated[Metres, Meta(ge=0.08, le=2.0)] = 0.2
    range: Annotated[Metres, Meta(ge=0.01, le=1.8)] = 0.1
    resolution: Annotated[Metres, Meta(ge=1e-6, le=0.1)] = 1e-3
    force_resolution: Annotated[Newtons, Meta(ge=1e-4, le=10.0)] = 0.15
    forces: tuple[Newtons, Newtons] = (0.1, 2.0)
    gauge: Annotated[Metres, Meta(ge=1e-4, le=1.5e-3)] | None = None
    tension: Annotated[Newtons, Meta(ge=2.0, le=500.0)] | None = None
    wire: str = "music_wire"
    frame: str = "steel"
    mount: MountName = "bolted"
    material: str = "plastic"
    contact_share: Annotated[float, Meta(ge=0.0, le=3.0)] = CONTACT_SHARE
    line_std: Annotated[float, Meta(ge=1e-6, le=0.1)] = LINE_STD
    open_std: Annotated[float, Meta(ge=1e-6, le=0.1)] = OPEN_STD
    end_std: Annotated[Metres, Meta(ge=0.0, le=0.01)] = END_STD
    window: Annotated[Seconds, Meta(ge=0.01, le=2.0)] = 0.1
    gap: Annotated[Metres, Meta(ge=2e-4, le=2e-2)] = 1.5e-3
    level: Annotated[float, Meta(ge=0.05, le=20.0)] = 1.0
    model: str = "demo"

    @property
    def usual(self) -> Newtons:
        """The press at which strings are compared: 1 N, if it is among the forces."""
        return min(max(1.0, self.forces[0]), self.forces[1])

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.range > self.length - 2.0 * COIL_ROOM:
            given = f"a range of {self.range:g} m on a string of {self.length:g} m"
            expected = f"{max(self.length - 2.0 * COIL_ROOM, 0.0):.3g} m or less"
            raise InputError(given, expected, "coils need 45 mm at either end: make the string longer")
        if not 1e-4 <= self.forces[0] < self.forces[1] <= 10.0:
            raise InputError(
                f"forces {self.forces[0]:g} to {self.forces[1]:g} N", "1e-4 <= least < largest <= 10"
            )
        for kind, name, known in (("wire", self.wire, WIRES), ("frame", self.frame, FRAMES)):
            if name not in known:
                raise InputError(f"{kind} '{name}'", ", ".join(known), did_you_mean(name, known))
        load_material(self.material)


@dataclass(frozen=True, slots=True, kw_only=True)
class StringCandidate:
    """A string with what it does; worst over the range, and of a press of 1 N, where not said otherwise.

    `position_std` in m and `force_std` in N are bounds; `force_std_most` is that of the largest press.
    `drift` is in cents a kelvin and `drift_force` what a kelvin reads as in N, unless the open pitch is
    followed. `settling` in s is that of a touch, `bandwidth` in Hz that of changes of a held touch. `stress`
    is that under the largest press. `swing` and `sag`, by the driver and by that press, bring the string
    nearer to a pole. `fits_model` is whether the wished model takes the string, None where it was not asked.
    `lacks` says which wishes it does not meet.
    """

    string: StringParams
    range: tuple[Metres, Metres]
    frequency: Hertz
    lowest: Hertz
    highest: Hertz
    position_std: Metres
    force_std: Newtons
    force_std_most: Newtons
    cents_per_newton: float
    drift: float
    drift_force: Newtons
    settling: Seconds
    bandwidth: Hertz
    stress: Pascals
    stress_share: float
    swing: Metres
    sag: Metres
    fits_model: bool | None = None
    lacks: tuple[str, ...] = field(default=())

    @property
    def clearance(self) -> Metres:
        """Distance from the string at rest to a pole below which it squeals or strikes, in m."""
        return self.swing + self.sag + CLEARANCE_MARGIN


def string_of(wishes: Wishes, gauge: Metres, tension: Newtons, length: Metres) -> StringParams:
    """Return a plain string; under 1 N at its middle its tension rises by `tension_per_force` newtons.

    >>> string = string_of(Wishes(), 0.254e-3, 65.0, 0.2)
    >>> round(open_frequency(string)), round(string.tension_per_force, 2)
    (1011, 0.3)
    """
    wire = WIRES[wishes.wire]
    density = wire.density * pi * gauge**2 / 4.0
    stretch = wire.modulus * pi * gauge**2 / 4.0
    return StringParams(
        length=length,
        linear_density=density,
        tension=tension,
        core_diameter=gauge,
        young_modulus=wire.modulus,
        damping=2.0 * density / 0.065,
        tension_per_force=stretch / (8.0 * tension**2),
    )


def bounds_at(wishes: Wishes, string: StringParams, contact: Contact) -> tuple[Metres, Newtons]:
    """Return the smallest standard errors of position and force of a touch, in m and N.

    A bolted object, one of unknown mount between two fingers, and one whose mount is known:

    >>> string = string_of(Wishes(), 0.254e-3, 65.0, 0.2)
    >>> touch = Contact(position=0.077, force=1.0)
    >>> [round(bounds_at(Wishes(mount=each), string, touch)[1], 2) for each in ("bolted", "light", "known")]
    [0.13, 0.32, 0.13]
    """
    lines = np.array(segment_frequencies(string, contact, "geometric"))
    surface = contact_compliance(string, _material(wishes.material), contact.force)
    give = lengthening(string, lines, mount=wishes.mount, contact=surface, contact_share=wishes.contact_share)
    return contact_bound(
        string,
        contact,
        SNR,
        duration=wishes.window,
        sample_rate=SAMPLE_RATE,
        highest=max(8000.0, 2.0 * float(lines.max())),
        law="geometric",
        end_std=wishes.end_std,
        open_frequency_std=wishes.open_std * open_frequency(string),
        lengthening_std=give.std,
        lengthening_correlation=give.correlation,
        lengthening_slope=-string.tension * surface / (3.0 * contact.force),
        line_std=wishes.line_std,
        force_prior_std=(wishes.forces[1] - wishes.forces[0]) / sqrt(12.0),
    )


def candidate(wishes: Wishes, gauge: Metres, tension: Newtons, length: Metres) -> StringCandidate:
    """Return what one string does, and which wishes it does not meet.

    >>> one = candidate(Wishes(frame="aluminium"), 0.254e-3, 65.0, 0.2)
    >>> round(one.stress / 1e6), round(one.drift, 2), round(1e3 * one.swing, 2), one.lacks
    (1306, 1.53, 0.15, ('force 0.16 N (wanted 0.15 N)',))
    """
    string, wire = string_of(wishes, gauge, tension, length), WIRES[wishes.wire]
    ends = 0.5 * (length - wishes.range), 0.5 * (length + wishes.range)
    middle, usual = 0.5 * length, wishes.usual
    places = (
        ends[0],
        middle + 1e-3 * length,
    )  # the bound of force is worst at an end, that of position may be inside
    each = [bounds_at(wishes, string, Contact(position=x, force=usual)) for x in places]
    most = [bounds_at(wishes, string, Contact(position=x, force=wishes.forces[1]))[1] for x in places]
    under = float(geometric_tension(string, middle, wishes.forces[1]))
    slope = float(frequency_sensitivities(string, Contact(position=middle, force=usual), "geometric")[0, 1])
    f1 = float(segment_frequencies(string, Contact(position=middle, force=usual), "geometric")[0])
    first = open_frequency(string)
    lines = first * length / ends[1], first * length / ends[0]
    rate = float(decay_rates(string, sensor_losses(), np.array([lines[0]]))[0])
    per_kelvin = 0.5 * stretch_stiffness(string) / tension * (FRAMES[wishes.frame] - wire.expansion)
    area = pi * gauge**2 / 4.0
    made = StringCandidate(
        string=string,
        range=ends,
        frequency=first,
        lowest=lines[0],
        highest=lines[1],
        position_std=max(x for x, _ in each),
        force_std=max(force for _, force in each),
        force_std_most=max(most),
        cents_per_newton=CENTS * slope / f1,
        drift=CENTS * per_kelvin,
        drift_force=per_kelvin * f1 / slope,
        settling=SETTLED / rate,
        bandwidth=rate / (2.0 * pi),
        stress=under / area,
        stress_share=under / area / wire.strength,
        swing=_swing(wishes, string),
        sag=_sag(wishes, string, ends),
    )
    return replace(made, lacks=_lacks(wishes, made))


def _lacks(wishes: Wishes, one: StringCandidate) -> tuple[str, ...]:
    lacks = list[str]()
    if one.force_std > wishes.force_resolution:
        lacks.append(f"force {one.force_std:.2g} N (wanted {wishes.force_resolution:g} N)")
    if one.position_std > wishes.resolution:
        lacks.append(f"position {1e3 * one.position_std:.2g} mm (wanted {1e3 * wishes.resolution:g} mm)")
    if one.stress_share > MAX_STRESS_SHARE:
        lacks.append(f"stress {one.stress_share:.0%} of the wire's strength")
    if one.clearance > wishes.gap:
        lacks.append(f"clearance {1e3 * one.clearance:.2g} mm (gap {1e3 * wishes.gap:g} mm)")
    if one.lowest * wishes.window < 3.0 or one.highest > 8000.0:
        lacks.append(f"lines from {one.lowest:.0f} to {one.highest:.0f} Hz")
    if not 20.0 <= one.frequency <= 5000.0:
        lacks.append(f"open pitch {one.frequency:.0f} Hz")
    return tuple(lacks)


@cache
def base_sensor() -> Sensor:
    """Return the design whose drivers, pickups and losses every design takes over: the prototype."""
    return load_sensor("prototype")


def sensor_losses() -> Losses:
    """Return the losses of a string on the presets' supports."""
    return base_sensor().losses


@cache
def _material(name: str) -> Material:
    return load_material(name)


def coils(length: Metres, range_: Metres) -> tuple[tuple[Metres, Metres], tuple[Metres, Metres]]:
    """Return the places of sense and drive coil of both drivers, in m: in the room beside the range.

    Each coil's share of that room is the prototype's.

    >>> [round(1e3 * place) for pair in coils(0.3, 0.2) for place in pair]
    [15, 28, 278, 289]
    """
    base = base_sensor()
    room, margin = 0.5 * (length - range_), base.range[0]
    near, far = ((each.sense, each.drive) for each in base.drivers)
    sense, drive = (room * place / margin for place in near)
    beyond = [length - room * (base.string.length - place) / margin for place in far]
    return (sense, drive), (beyond[0], beyond[1])


def _swing(wishes: Wishes, string: StringParams) -> Metres:
    """Return the largest swing to which one driver at its limit brings the untouched fundamental.

    A saturated driver pushes with a square wave, whose fundamental is 4 F / pi, on m = mu L / 2 at resonance.
    """
    omega = 2.0 * pi * open_frequency(string)
    sigma = float(decay_rates(string, sensor_losses(), np.array([omega / (2.0 * pi)]))[0])
    limit = wishes.level * max(each.limit for each in base_sensor().drivers)
    push = max(sin(pi * drive / string.length) for _, drive in coils(string.length, wishes.range)) * limit
    return 4.0 / pi * push / (string.linear_density * string.length * sigma * omega)


def _sag(wishes: Wishes, string: StringParams, ends: tuple[Metres, Metres]) -> Metres:
    """Return how far the largest press, at an end of the range, brings the string nearer to a coil."""
    length = string.length
    return max(
        wishes.forces[1] * min(at, coil) * (length - max(at, coil)) / (string.tension * length)
        for at in ends
        for pair in coils(length, wishes.range)
        for coil in pair
    )


def sweep(wishes: Wishes, *, trained: Metres | None = None) -> list[StringCandidate]:
    """Return every string of the sweep: gauges, tensions and lengths, less those that would break.

    A given gauge or tension is not varied. Lengths are the whole, two shorter ones that hold the range, and
    the nearest to the length `trained` that a model knows.
    """
    least = wishes.range + 2.0 * COIL_ROOM
    lengths = {round(least + share * (wishes.length - least), 4) for share in (0.0, 0.5, 1.0)}
    if trained is not None:
        lengths.add(round(min(max(trained, least), wishes.length), 4))
    gauges = GAUGES if wishes.gauge is None else (wishes.gauge,)
    tensions = TENSIONS if wishes.tension is None else (wishes.tension,)
    strength = WIRES[wishes.wire].strength
    return [
        candidate(wishes, gauge, float(tension), length)
        for gauge, tension, length in product(gauges, tensions, sorted(lengths))
        if tension / (pi * gauge**2 / 4.0) < strength
    ]


def recommended(wishes: Wishes, candidates: list[StringCandidate]) -> StringCandidate:
    """Return the string to build: of those that meet every wish the fastest, else the one that lacks least.

    Among the fastest, within 5 %, the one with the smaller force bound; among those that lack as little, too.
    Where a model is to take the string, others are recommended only if it takes none. Raises `InputError` if
    no string bears its tension.
    """
    if not candidates:
        given = (
            f"a wire of {wishes.gauge:g} m at {wishes.tension:g} N"
            if wishes.gauge and wishes.tension
            else "wishes"
        )
        raise InputError(given, "a string that bears its tension", "lower the tension, or use a thicker wire")
    taken = [each for each in candidates if each.fits_model] or candidates
    fewest = min(len(each.lacks) for each in taken)
    best = [each for each in taken if len(each.lacks) == fewest]
    if fewest:
        return min(best, key=lambda each: (max(each.stress_share - MAX_STRESS_SHARE, 0.0), each.force_std))
    fastest = min(each.settling for each in best)
    return min((each for each in best if each.settling <= 1.05 * fastest), key=lambda each: each.force_std)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ambiguity:
    """Places whose pair of lines another place explains, too, with other modes and a tension within reach.

    `positions` (n,) in m; `pairs` (n,) is how many of the 36 pairs of modes up to 6 have such a double, and
    `fundamental` (n,) whether the pair of fundamentals has one. `share` is the mean share of pairs.
    """

    positions: Floats
    pairs: Floats
    fundamental: Floats

    @property
    def share(self) -> float:
        """Mean share of the pairs of modes that a place shares with another."""
        return float(self.pairs.mean()) / MAX_MODE**2


def ambiguity(wishes: Wishes, string: StringParams, count: int = 161) -> Ambiguity:
    """Return where pairs of lines are ambiguous, along the range under a usual press.

    Lines m f1(x) and n f2(x) are read as m' and n' by mistake. They then give another place and another
    tension, which is only possible between that at rest and that under the largest press at that place,
    within three standard errors. A place nearer than three times the position's bound or the wished
    resolution is the same.

    A string whose tension rises more has more doubles:

    >>> tight, slack = (string_of(Wishes(), 0.254e-3, tension, 0.2) for tension in (65.0, 20.0))
    >>> ambiguity(Wishes(), tight).share < ambiguity(Wishes(), slack).share
    True
    """
    ends = 0.5 * (string.length - wishes.range), 0.5 * (string.length + wishes.range)
    x = np.linspace(*ends, count)
    force = wishes.usual
    f1, f2 = (np.array(each) for each in _lines(string, x, force))
    n = np.arange(1, MAX_MODE + 1)
    m, n, other_m, other_n = (each.ravel() for each in np.meshgrid(n, n, n, n, indexing="ij"))
    one, two = np.outer(m / other_m, f1), np.outer(n / other_n, f2)
    place = locate_from_segments(string.length, one, two)
    tension = tension_from_segments(string, one, two)
    inside = (place >= ends[0]) & (place <= ends[1])
    most = np.array(geometric_tension(string, np.clip(place, *ends), np.array(wishes.forces[1])))
    margin = 3.0 * 2.0 * sqrt(wishes.open_std**2 + 0.5 * wishes.line_std**2)
    inside &= (tension > string.tension * (1.0 - margin)) & (tension < most * (1.0 + margin))
    inside &= np.abs(place - x) > wishes.resolution
    inside &= ((m != other_m) | (n != other_n))[:, None]
    doubled = inside.reshape(MAX_MODE**2, MAX_MODE**2, count).any(axis=1)
    return Ambiguity(
        positions=x, pairs=doubled.sum(axis=0).astype(float), fundamental=doubled[0].astype(float)
    )


def _lines(string: StringParams, x: Floats, force: Newtons) -> tuple[Floats, Floats]:
    half = np.sqrt(geometric_tension(string, x, np.array(force)) / string.linear_density) / 2.0
    return half / x, half / (string.length - x)


@dataclass(frozen=True, slots=True, kw_only=True)
class StringCurves:
    """Along the range, (n,): lines in Hz, their slopes in Hz/m and Hz/N (n, 2, 2), and bounds in m and N.

    `forces` (k,) are the presses of the bounds (k, n).
    """

    positions: Floats
    forces: Floats
    lines: Floats
    slopes: Floats
    position_std: Floats
    force_std: Floats


def curves(wishes: Wishes, string: StringParams, count: int = 21) -> StringCurves:
    """Return lines, slopes and bounds along the range, under the least, a usual and the largest press."""
    ends = 0.5 * (string.length - wishes.range), 0.5 * (string.length + wishes.range)
    x = np.linspace(*ends, count)
    usual = wishes.usual
    forces = np.array(sorted({wishes.forces[0], usual, wishes.forces[1]}))
    bounds = np.array(
        [
            [bounds_at(wishes, string, Contact(position=p, force=f)) for p in x.tolist()]
            for f in forces.tolist()
        ]
    )
    slopes = [
        frequency_sensitivities(string, Contact(position=p, force=usual), "geometric") for p in x.tolist()
    ]
    return StringCurves(
        positions=x,
        forces=forces,
        lines=np.array(_lines(string, x, usual)).T,
        slopes=np.array(slopes),
        position_std=bounds[..., 0],
        force_std=bounds[..., 1],
    )


def sensor_from(wishes: Wishes, chosen: StringCandidate) -> Sensor:
    """Return a sensor of a string: the prototype's drivers and pickups in proportion to length and pitch."""
    base, string = base_sensor(), chosen.string
    scale = chosen.frequency / open_frequency(base.string)

    def driver(each: Ebow, places: tuple[Metres, Metres]) -> Ebow:
        centre = min(max(scale * each.centre, 20.0), 12000.0)
        return replace(each, sense=places[0], drive=places[1], centre=centre, level=wishes.level)

    near, far = (driver(*each) for each in zip(base.drivers, coils(string.length, wishes.range), strict=True))
    gauge, tension, wire = 1e3 * string.core_diameter, string.tension, wishes.wire.replace("_", " ")
    return replace(
        base,
        name="design",
        title=f"{1e3 * string.length:.0f} mm of {gauge:.3f} mm {wire} at {tension:.0f} N",
        source="monochord design; drivers and pickups like those of the preset prototype",
        notes="Assumed: all of it. Coils and bands are the prototype's, in proportion to room and pitch.",
        string=string,
        drivers=(near, far),
        range=chosen.range,
        frame_expansion=FRAMES[wishes.frame],
        string_expansion=WIRES[wishes.wire].expansion,
    )


def stretch_cents(string: StringParams, swing: Metres) -> float:
    """Return by how many cents a swing of the fundamental raises the pitch: E A pi^2 a^2 / (8 L^2) over T.

    >>> round(stretch_cents(string_of(Wishes(), 0.254e-3, 65.0, 0.2), 1.5e-4), 2)
    0.09
    """
    rise = stretch_stiffness(string) * (pi * swing / string.length) ** 2 / 8.0
    return 600.0 * log2(1.0 + rise / string.tension)
