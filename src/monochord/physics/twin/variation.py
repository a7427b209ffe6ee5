"""Random variation: another sensor of the same design, and the same sensor on another day, each from a seed.

Every quantity has a random stream of its own, by name and seed, so that adding or removing a tolerance leaves
the other draws unchanged. All are normal, truncated at 2.5 standard deviations, and clipped to the range that
`Sensor` allows.
"""

from dataclasses import replace
from math import exp, log
from zlib import crc32

import numpy as np

from monochord.core.types import StringParams
from monochord.core.units import Newtons
from monochord.physics.setup import Ebow, Pickups, Sensor
from monochord.physics.theory import Losses, stretch_stiffness

TRUNCATION = 2.5
"""Standard deviations at which draws are truncated: a part further off would be rejected."""
MIN_END_DISTANCE = 1e-3
"""Of a coil from an end, in m."""
HOUR = 3600.0


def build(sensor: Sensor, seed: int) -> Sensor:
    """Return another sensor of the same design, drawn from `sensor.tolerances`.

    Density goes with the square of the wire's diameter, and its stretch and bending stiffness follow
    `core_diameter`. The tension brings that wire to its pitch, with a tuning error of c cents:
    T ~ rho L^2 2^(c/600). Range, frame, polarity and all electronics that are not named keep their values.
    The sensor's name says the seed, 0 or more.

    Examples
    --------
    >>> from monochord.physics.sensors import load_sensor
    >>> design = load_sensor("prototype")
    >>> build(design, 3) == build(design, 3), build(design, 3) == build(design, 4)
    (True, False)
    """
    allowed, string = sensor.tolerances, _wire(sensor, seed)
    drivers = tuple(_driver(sensor, string, d, seed) for d in range(2))
    pickups, losses = sensor.pickups, sensor.losses
    share = [_normal(seed, f"loss {i}") for i in range(3)]
    return replace(
        sensor,
        name=f"{sensor.name}, build {seed}",
        string=string,
        drivers=(drivers[0], drivers[1]),
        pickups=replace(
            pickups,
            own=_pair(pickups.own, [allowed.own * _normal(seed, f"own {i}") for i in range(2)]),
            gain=_gains(pickups, allowed.pickup_gain, seed, "pickup gain"),
            angle=_clipped(pickups.angle + allowed.tilt * _normal(seed, "pickup tilt"), -np.pi, np.pi),
        ),
        losses=Losses(
            air_viscosity=losses.air_viscosity,
            air_density=losses.air_density,
            viscoelastic=losses.viscoelastic * (1.0 + allowed.losses * share[0]),
            thermoelastic=losses.thermoelastic * (1.0 + allowed.losses * share[1]),
            support=losses.support * (1.0 + allowed.losses * share[2]),
        ),
    )


def day(sensor: Sensor, seed: int) -> Sensor:
    """Return the same sensor on another day: its `changes` of tension, drivers and pickups, drawn.

    The tension changes with temperature, creep and, within the session, warming: see `tension_per_kelvin`.
    String, places of coils, bands, losses and crosstalk stay as built, `drift`, `drift_rate`, gains and
    limits of drivers, and gains of pickups change. One seed, 0 or more, draws the same day for every sensor.

    >>> from monochord.physics.sensors import load_sensor
    >>> today = day(load_sensor("prototype"), 1)
    >>> today.string == load_sensor("prototype").string, today.drift == 0.0
    (True, False)
    """
    changes, per_kelvin = sensor.changes, tension_per_kelvin(sensor)
    drift = sensor.drift + per_kelvin * changes.temperature * _normal(seed, "temperature")
    drift -= changes.creep * abs(_normal(seed, "creep"))
    rate = sensor.drift_rate + per_kelvin * changes.warming / HOUR * _normal(seed, "warming")
    limit = 0.25 * sensor.string.tension
    drivers = [
        replace(
            driver,
            gain=_clipped(driver.gain * (1.0 + changes.gain * _normal(seed, f"day gain {d}")), -10.0, 10.0),
            limit=_clipped(driver.limit * (1.0 + changes.limit * _normal(seed, f"day limit {d}")), 0.0, 1.0),
        )
        for d, driver in enumerate(sensor.drivers)
    ]
    return replace(
        sensor,
        name=f"{sensor.name}, day {seed}",
        drivers=(drivers[0], drivers[1]),
        pickups=replace(
            sensor.pickups, gain=_gains(sensor.pickups, changes.pickup_gain, seed, "day pickup gain")
        ),
        drift=_clipped(drift, -min(50.0, limit), min(50.0, limit)),
        drift_rate=_clipped(rate, -1.0, 1.0),
    )


def random_stream(seed: int, name: str) -> np.random.Generator:
    """Return the random stream of one quantity, by its name and a seed.

    >>> random_stream(1, "length").random() == random_stream(1, "length").random()
    True
    """
    return np.random.default_rng([seed, crc32(name.encode())])


def uniform(seed: int, name: str, range_: tuple[float, float]) -> float:
    """Return the draw of one quantity, evenly over its range.

    >>> 2.0 <= uniform(1, "length", (2.0, 3.0)) <= 3.0
    True
    """
    return float(random_stream(seed, name).uniform(*range_))


def log_uniform(seed: int, name: str, range_: tuple[float, float]) -> float:
    """Return the draw of one quantity, evenly over the logarithm of its range.

    >>> 2.0 <= log_uniform(1, "length", (2.0, 3.0)) <= 3.0
    True
    """
    return exp(uniform(seed, name, (log(range_[0]), log(range_[1]))))


def tension_per_kelvin(sensor: Sensor) -> Newtons:
    """Return the rise of tension a kelvin, in N/K.

    dT = E A (alpha_frame - alpha_string) dtheta: frame and wire have one temperature, and the frame is rigid.
    A frame that expands more than its string, as aluminium does with steel, tightens it.

    >>> from monochord.physics.sensors import load_sensor
    >>> round(tension_per_kelvin(load_sensor("prototype")), 3)
    0.115
    """
    return float(stretch_stiffness(sensor.string) * (sensor.frame_expansion - sensor.string_expansion))


def _wire(sensor: Sensor, seed: int) -> StringParams:
    string, allowed = sensor.string, sensor.tolerances
    thick = 1.0 + allowed.diameter * _normal(seed, "diameter")
    length = string.length + allowed.length * _normal(seed, "length")
    pitch = 2.0 ** (allowed.tuning * _normal(seed, "tuning") / 600.0)
    return replace(
        string,
        length=length,
        linear_density=string.linear_density * thick**2,
        core_diameter=string.core_diameter * thick,
        tension=string.tension * thick**2 * (length / string.length) ** 2 * pitch,
    )


def _driver(sensor: Sensor, string: StringParams, index: int, seed: int) -> Ebow:
    driver, allowed = sensor.drivers[index], sensor.tolerances

    def draw(name: str) -> float:
        return _normal(seed, f"driver {index} {name}")

    return Ebow(
        sense=_clipped(
            driver.sense + allowed.places * draw("sense"), MIN_END_DISTANCE, string.length - MIN_END_DISTANCE
        ),
        drive=_clipped(
            driver.drive + allowed.places * draw("drive"), MIN_END_DISTANCE, string.length - MIN_END_DISTANCE
        ),
        aperture=_clipped(driver.aperture * (1.0 + allowed.aperture * draw("aperture")), 0.0, 0.05),
        centre=_clipped(driver.centre * (1.0 + allowed.centre * draw("centre")), 20.0, 12000.0),
        quality=_clipped(driver.quality * (1.0 + allowed.quality * draw("quality")), 0.1, 20.0),
        gain=_clipped(driver.gain * (1.0 + allowed.gain * draw("gain")), -10.0, 10.0),
        limit=_clipped(driver.limit * (1.0 + allowed.limit * draw("limit")), 0.0, 1.0),
        angle=_clipped(driver.angle + allowed.tilt * draw("tilt"), -np.pi, np.pi),
    )


def _gains(pickups: Pickups, share: float, seed: int, name: str) -> tuple[float, float]:
    first, second = (
        _clipped(gain * (1.0 + share * _normal(seed, f"{name} {i}")), 0.0, 1e4)
        for i, gain in enumerate(pickups.gain)
    )
    return first, second


def _pair(values: tuple[float, float], changes: list[float]) -> tuple[float, float]:
    return _clipped(values[0] + changes[0], 0.0, 1.0), _clipped(values[1] + changes[1], 0.0, 1.0)


def _clipped(value: float, low: float, high: float) -> float:
    return float(min(high, max(low, value)))


def _normal(seed: int, name: str) -> float:
    """Return the draw of one quantity: standard normal, truncated at `TRUNCATION`."""
    stream = random_stream(seed, name)
    while abs(value := float(stream.standard_normal())) > TRUNCATION:
        pass
    return value
