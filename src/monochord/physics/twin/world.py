"""Worlds: `ideal`, the twin as its design says, and `plausible`, with what a real build brings besides.

The ideal world has rigid ends and objects, Hertz's contact and a linear chain. A plausible sensor is retuned,
creeps and is warmed; its string is longer or shorter than designed, and tightens under a press by more than
it stretches; its ends yield, its drivers are stronger, uneven and magnetic; its chain distorts, hums and
picks up the coils. A plausible object gives way, and its surface is rough, and round, flat or sharp, of a
width, and resists turning. Each of these effects is a switch of `Effects`, and each of its quantities is
drawn from a stated range by a random stream of its own, by name and seed: to switch one off leaves the others
as they were.

Quantities whose size is not known are drawn evenly over their logarithm, others evenly over their range. The
ranges are what a careful reviewer would expect; each names its source or the word assumed.

References: Feinberg and Yang (2018), Natural frequencies of vibrating strings with magnetic pickups, J.
Acoust. Soc. Am. 144; Fleischer (1999), Dead spots of electric guitars and basses, ASA/EAA/DAGA, Berlin;
Persson (2007), Phys. Rev. Lett. 99, 125502; Pastewka et al. (2013), Phys. Rev. E 87, 062809.
"""

from dataclasses import dataclass, fields, replace
from typing import Literal, get_args

from monochord.core.errors import InputError
from monochord.core.units import Hertz, Metres, Newtons
from monochord.physics.setup import ContactLaw, Ebow, End, Mount, Pickups, Sensor, Touch, lengthened
from monochord.physics.twin.held import drawn_mount
from monochord.physics.twin.variation import build as build_of
from monochord.physics.twin.variation import day as day_of
from monochord.physics.twin.variation import log_uniform, random_stream, uniform

World = Literal["ideal", "plausible"]
Shape = Literal["round", "flat", "edge"]

TUNING = -0.06, 0.06
"""Relative change of the tension by retuning by hand and by creep, half a semitone: assumed."""
TEMPERATURE = 8.0
"""Standard deviation in K since tuning, truncated at 20 K: a sensor in a hall or in a van, assumed."""
LEVEL = 0.5, 8.0
"""Of a driver against its design: another EBow, or another height over the string, assumed. The preamplifiers
are then turned down by the louder one, where that is above 1, as whoever sets them up would do."""
BIAS = -0.5, 0.5
"""Of a driver's saturation, assumed: a second harmonic of up to -15 dB in its force. The force on a
magnetised wire goes with the square of the flux."""
PULL = 2.0, 40.0
"""Negative stiffness of a driver's magnet in N/m: it splits the polarisations of the prototype by up to 2 Hz,
the order that a pickup's magnet splits a guitar string's (Feinberg and Yang 2018)."""
END_STIFFNESS = 3e5, 3e7
"""Of an end, in N/m: tuner and saddle, assumed; 65 N lengthen the string by 2 to 200 um."""
END_ADMITTANCE = 1e-4, 1e-2
"""At its resonance, in s/kg, assumed: an aluminium bar between the bridge of a solid electric guitar, which
hardly moves, and the dead spots of its neck (Fleischer 1999)."""
END_FREQUENCY: tuple[Hertz, Hertz] = (300.0, 4000.0)
END_QUALITY = 2.0, 20.0
"""Of the resonance of an end: assumed."""
DISTORTION = -70.0, -40.0
"""Second and third harmonic of the preamplifier at half of full scale, in dB, of either sign: assumed."""
SNR = 30.0, 60.0
"""Of a channel, in dB: `SIGNAL` over the noise of preamplifier and converter, assumed."""
SIGNAL = 0.1
"""Rms in full scale of a usual sound."""
HUM = -80.0, -50.0
"""Rms of the mains in a channel, in dB of full scale: assumed."""
FEED = -80.0, -50.0
"""What a driver's coil at its nominal limit induces in a pickup, in dB of full scale, of either sign:
assumed."""
LENGTH = -0.01, 0.01
"""Relative difference of the string's length from the design's: a frame printed or sawn by hand, a nut and a
saddle 2 mm wide on which the string may end anywhere. Assumed."""
RULER: tuple[Metres, Metres] = (-5e-4, 5e-4)
"""Error of a length that is read off a ruler with a millimetre scale."""
PRESS_TENSION = 0.0, 1.0
"""Share of the string's `tension_per_force` that a press adds to the geometric law: at 1 the paper's
T = T0 + kT F beside the stretch, as a frame that bends, or a nut on which the string sticks, may bring.
Assumed."""
EXPONENT = 1.0, 1.5
"""Of the contact law at 1 N: between a line contact's or a layered print's and Hertz's."""
LAYER_SHARE = 0.28, 0.57
"""u0 of the rough layer over the rms height: 0.4 (Persson 2007), and a root of two to either side."""
LAYER_LOAD: tuple[Newtons, Newtons] = (3e-3, 3e-2)
"""Below which a layer's stiffness no longer follows its load, as so small a patch has few asperities: a
finite size as in Pastewka et al. (2013), the force assumed."""
SHAPES: tuple[tuple[Shape, float], ...] = (("round", 0.6), ("flat", 0.2), ("edge", 0.2))
"""How often an object at rest meets the string with which shape: assumed."""
FLAT_WIDTH: tuple[Metres, Metres] = (2e-4, 4e-3)
"""Length of string under a flat object: from a worn edge to the side of a ruler. Assumed; below, a contact is
a point beside the 0.8 mm over which the prototype's string bends."""
EDGE_RADIUS: tuple[Metres, Metres] = (2e-4, 1e-3)
"""Radius of an edge such as a hexagonal key's: assumed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effects:
    """Which effects the plausible world has, each a switch.

    Of the day: `tuning` (retuning by hand and creep) and `temperature`. Of the build: its `length`, the
    `tension_law` between the geometric and the linear one; `ends` that yield;
    drivers of another `level`, uneven (`asymmetry`) and with `magnets` that pull; `distortion`, `noise`,
    `hum`, and the coils' `feed_through`; and `residual`, the static share of the modes beyond the bank in
    the end forces. Of a touch: its `mount`, the exponent of its contact `law`, its rough `layer`, its
    `shape`, flat or an edge, the `width` of a flat, and the `turning` that a round one resists.
    """

    tuning: bool = True
    temperature: bool = True
    ends: bool = True
    level: bool = True
    asymmetry: bool = True
    magnets: bool = True
    distortion: bool = True
    noise: bool = True
    hum: bool = True
    feed_through: bool = True
    residual: bool = True
    mount: bool = True
    law: bool = True
    layer: bool = True
    shape: bool = True
    length: bool = True
    tension_law: bool = True
    width: bool = True
    turning: bool = True


ALL = Effects()


def only(*names: str) -> Effects:
    """Return the effects of these names, all others off.

    >>> only("hum").hum, only("hum").mount
    (True, False)
    """
    return Effects(**{field.name: field.name in names for field in fields(Effects)})


def sensor_of(
    design: Sensor,
    world: World = "ideal",
    *,
    build: int | None = None,
    day: int | None = None,
    effects: Effects = ALL,
) -> Sensor:
    """Return a sensor of a design in a world, of one build and on one day.

    Parameters
    ----------
    design
        With its nominal values.
    world
        ``ideal``: only what the design's `tolerances` and `changes` say; ``plausible``: the effects besides.
    build
        Seed of the build. None is the design's own strings, drivers and pickups; the plausible world's
        effects are then those of seed 0.
    day
        Seed of the day. None is the day on which it was tuned.
    effects
        Which effects the plausible world has.

    Raises
    ------
    InputError
        For an unknown world.

    Examples
    --------
    >>> from monochord.physics.sensors import load_sensor
    >>> design = load_sensor("prototype")
    >>> sensor_of(design) == design, sensor_of(design, "plausible") == design
    (True, False)
    """
    if world not in get_args(World):
        raise InputError(f"world '{world}'", ", ".join(get_args(World)))
    built = design if build is None else build_of(design, build)
    if world == "ideal":
        return built if day is None else day_of(built, day)
    built = plausible_build(built, build or 0, effects)
    return built if day is None else plausible_day(built, day, effects)


def plausible_build(sensor: Sensor, seed: int, effects: Effects = ALL) -> Sensor:
    """Return a sensor with the effects that it has as built.

    `sensor` is built to its tolerances, see `monochord.physics.twin.variation.build`.

    >>> from monochord.physics.sensors import load_sensor
    >>> design = load_sensor("prototype")
    >>> plausible_build(design, 3, only("hum")).drivers == design.drivers
    True
    """
    sensor = _built(sensor, seed, effects)
    first, second = (_driver(driver, d, seed, effects) for d, driver in enumerate(sensor.drivers))
    return replace(
        sensor,
        drivers=(first, second),
        ends=(_end(0, seed), _end(1, seed)) if effects.ends else sensor.ends,
        pickups=_pickups(sensor, seed, effects),
    )


def plausible_day(sensor: Sensor, seed: int, effects: Effects = ALL) -> Sensor:
    """Return the same sensor on another day: its `changes`, by a wider range of temperatures, and its tuning.

    >>> from monochord.physics.sensors import load_sensor
    >>> abs(plausible_day(load_sensor("prototype"), 1, only("tuning")).drift) < 6.0
    True
    """
    changes = sensor.changes
    warmer = replace(changes, temperature=TEMPERATURE) if effects.temperature else changes
    later = replace(day_of(replace(sensor, changes=warmer), seed), changes=changes)
    if not effects.tuning:
        return later
    tension = sensor.string.tension
    limit = min(50.0, 0.25 * tension)
    drift = later.drift + tension * uniform(seed, "retuning", TUNING)
    return replace(later, drift=min(limit, max(-limit, drift)))


def plausible_touch(touch: Touch, seed: int, effects: Effects = ALL, world: World = "plausible") -> Touch:
    """Return a touch whose object is held by a mount and has a surface of its own, by its material and seed.

    A touch that states a mount, a law or a radius keeps it. An object that rolls as it moves stays round. In
    an ideal world the touch stays what it is.

    Parameters
    ----------
    touch
        With a rigid object of Hertz's contact.
    seed
        Random seed, 0 or more: of a gripper and its objects.
    effects
        Which effects it has.
    world
        Whose draws.

    Examples
    --------
    >>> from monochord.physics.materials import load_material
    >>> from monochord.physics.twin import hold
    >>> plausible_touch(hold(0.08, 1.0, load_material("wood")), 1).mount.kind
    'bolted'
    """
    if world == "ideal":
        return touch
    name = touch.material.name
    if effects.mount and touch.mount == Mount():
        touch = replace(touch, mount=drawn_mount(name, seed))
    if touch.law != ContactLaw():
        return touch
    law = touch.law
    if effects.law:
        law = replace(law, exponent=uniform(seed, f"exponent of {name}", EXPONENT))
    if effects.layer:
        share = log_uniform(seed, f"layer of {name}", LAYER_SHARE)
        load = log_uniform(seed, f"layer load of {name}", LAYER_LOAD)
        law = replace(law, layer=min(1e-4, share * touch.material.roughness), layer_load=load)
    shape = _shape(touch, seed) if effects.shape else "round"
    if shape == "flat":
        flat = log_uniform(seed, f"width of {name}", FLAT_WIDTH)
        law = replace(law, flat=flat, width=flat if effects.width else 0.0)
    if shape == "edge":
        touch = replace(touch, radius=log_uniform(seed, f"edge of {name}", EDGE_RADIUS))
    if effects.turning and shape != "flat":
        law = replace(law, arm=touch.material.radius if touch.radius is None else touch.radius)
    return replace(touch, law=law)


def _built(sensor: Sensor, seed: int, effects: Effects) -> Sensor:
    """Return a sensor of another length, tuned to its pitch, whose tension follows a press by more."""
    string = sensor.string
    if effects.length:
        longer = lengthened(sensor, 1.0 + uniform(seed, "length of the frame", LENGTH))
        measured = longer.string.length + uniform(seed, "ruler", RULER)
        sensor = replace(longer, measured_length=measured)
    if effects.tension_law:
        share = uniform(seed, "tension law", PRESS_TENSION)
        sensor = replace(sensor, press_tension=share * string.tension_per_force)
    return sensor


def _driver(driver: Ebow, index: int, seed: int, effects: Effects) -> Ebow:
    if effects.level:
        driver = replace(driver, level=_level(index, seed))
    if effects.asymmetry:
        driver = replace(driver, bias=uniform(seed, f"bias {index}", BIAS))
    if effects.magnets:
        driver = replace(driver, pull=log_uniform(seed, f"pull {index}", PULL))
    return driver


def _level(driver: int, seed: int) -> float:
    return log_uniform(seed, f"level {driver}", LEVEL)


def _end(index: int, seed: int) -> End:
    def draw(name: str, range_: tuple[float, float]) -> float:
        return log_uniform(seed, f"end {index} {name}", range_)

    return End(
        compliance=1.0 / draw("stiffness", END_STIFFNESS),
        admittance=draw("admittance", END_ADMITTANCE),
        frequency=draw("frequency", END_FREQUENCY),
        quality=draw("quality", END_QUALITY),
    )


def _pickups(sensor: Sensor, seed: int, effects: Effects) -> Pickups:
    pickups = sensor.pickups
    if effects.level:
        louder = max(1.0, *(_level(driver, seed) for driver in range(2)))
        pickups = replace(pickups, gain=(pickups.gain[0] / louder, pickups.gain[1] / louder))
    if effects.distortion:
        second, third = (_signed(seed, f"distortion {order}", DISTORTION) for order in (2, 3))
        pickups = replace(pickups, distortion=(second, third))
    if effects.noise:
        pickups = replace(pickups, hiss=SIGNAL / _ratio(uniform(seed, "snr", SNR)))
    if effects.hum:
        first, second = (_ratio(uniform(seed, f"hum {channel}", HUM)) for channel in range(2))
        mains = 50.0 if random_stream(seed, "mains").random() < 0.5 else 60.0
        pickups = replace(pickups, hum=(first, second), mains=mains)
    limit = max(driver.limit for driver in sensor.drivers)
    if effects.feed_through and limit > 0.0:
        same_side, other_side = (_signed(seed, f"feed {which}", FEED) / limit for which in ("own", "other"))
        pickups = replace(pickups, feed=(same_side, other_side))
    return replace(pickups, residual=True) if effects.residual else pickups


def _shape(touch: Touch, seed: int) -> Shape:
    moves = any(key.position != touch.motion[0].position for key in touch.motion)
    if touch.radius is not None or (touch.rolls and moves):
        return "round"
    draw = float(random_stream(seed, f"shape of {touch.material.name}").random())
    for shape, share in SHAPES:
        if draw < share:
            return shape
        draw -= share
    return SHAPES[-1][0]


def _signed(seed: int, name: str, decibels: tuple[float, float]) -> float:
    """Return an amplitude ratio of a range in dB, of either sign."""
    sign = 1.0 if random_stream(seed, f"sign of {name}").random() < 0.5 else -1.0
    return sign * _ratio(uniform(seed, name, decibels))


def _ratio(decibels: float) -> float:
    return 10.0 ** (decibels / 20.0)
