"""Another sensor of the same design, and the same sensor on another day: each drawn by one seed.

Every quantity has a stream of its own, named and seeded, so that a tolerance more or less leaves the other
draws as they were. All are normal, cut at 2.5 standard deviations, and end within what `Sensor` allows.
"""

from dataclasses import replace
from zlib import crc32

import numpy as np

from monochord.core.types import StringParams
from monochord.core.units import Newtons
from monochord.physics.theory import Losses, stretch_stiffness
from monochord.physics.twin.setup import Ebow, Pickups, Sensor

CUT = 2.5
"""Standard deviations at which draws are cut: what is further off would be sent back."""
EDGE = 1e-3
"""Least distance of a coil from an end, in m."""
HOUR = 3600.0


def build(sensor: Sensor, seed: int) -> Sensor:
    """Return another sensor of the same design, as `sensor.tolerances` allow.

    Density goes with the square of the wire's diameter, and so do its stretch and bending stiffness, by
    `core_diameter`. The tension is what brings that wire to its pitch, give or take the tuning's error of c
    cents: T ~ rho L^2 2^(c/600). Range, frame, polarity and everything electronic that is not named stay.

    Parameters
    ----------
    sensor
        The design, with its nominal values.
    seed
        Which of its sensors, 0 or more. The same seed gives the same sensor.

    Returns
    -------
    Sensor
        With the seed in its name.

    Examples
    --------
    >>> from monochord.physics.sensors import load_sensor
    >>> design = load_sensor("prototype")
    >>> build(design, 3) == build(design, 3), build(design, 3) == build(design, 4)
    (True, False)
    """
    allowed, string = sensor.tolerances, _wire(sensor, seed)
    drivers = tuple(_built(sensor, string, d, seed) for d in range(2))
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
            angle=_within(pickups.angle + allowed.tilt * _normal(seed, "pickup tilt"), -np.pi, np.pi),
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
    """Return the same sensor on another day, as `sensor.changes` say: drift of tension, drivers and pickups.

    The tension goes with temperature, creep and, within the session, with warming: see `tension_by_warmth`.
    String, places of coils, bands, losses and crosstalk stay as they were built.

    Parameters
    ----------
    sensor
        As built, see `build`.
    seed
        Which day, 0 or more. The same seed gives the same day to every sensor.

    Returns
    -------
    Sensor
        With other `drift`, `drift_rate`, gains and limits of drivers, and gains of pickups.

    Examples
    --------
    >>> from monochord.physics.sensors import load_sensor
    >>> today = day(load_sensor("prototype"), 1)
    >>> today.string == load_sensor("prototype").string, today.drift == 0.0
    (True, False)
    """
    changes, warmth = sensor.changes, tension_by_warmth(sensor)
    drift = sensor.drift + warmth * changes.temperature * _normal(seed, "temperature")
    drift -= changes.creep * abs(_normal(seed, "creep"))
    rate = sensor.drift_rate + warmth * changes.warming / HOUR * _normal(seed, "warming")
    most = 0.25 * sensor.string.tension
    drivers = [
        replace(
            driver,
            gain=_within(driver.gain * (1.0 + changes.gain * _normal(seed, f"day gain {d}")), -10.0, 10.0),
            limit=_within(driver.limit * (1.0 + changes.limit * _normal(seed, f"day limit {d}")), 0.0, 1.0),
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
        drift=_within(drift, -min(50.0, most), min(50.0, most)),
        drift_rate=_within(rate, -1.0, 1.0),
    )


def tension_by_warmth(sensor: Sensor) -> Newtons:
    """Return by how much a kelvin raises the tension, in N/K.

    dT = E A (alpha_frame - alpha_string) dtheta: frame and wire are as warm as each other, and the frame
    does not give. A frame that lengthens more than its string, as aluminium does with steel, pulls it
    tighter.

    Examples
    --------
    >>> from monochord.physics.sensors import load_sensor
    >>> round(tension_by_warmth(load_sensor("prototype")), 3)
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


def _built(sensor: Sensor, string: StringParams, index: int, seed: int) -> Ebow:
    driver, allowed = sensor.drivers[index], sensor.tolerances

    def off(name: str) -> float:
        return _normal(seed, f"driver {index} {name}")

    return Ebow(
        sense=_within(driver.sense + allowed.places * off("sense"), EDGE, string.length - EDGE),
        drive=_within(driver.drive + allowed.places * off("drive"), EDGE, string.length - EDGE),
        aperture=_within(driver.aperture * (1.0 + allowed.aperture * off("aperture")), 0.0, 0.05),
        centre=_within(driver.centre * (1.0 + allowed.centre * off("centre")), 20.0, 12000.0),
        quality=_within(driver.quality * (1.0 + allowed.quality * off("quality")), 0.1, 20.0),
        gain=_within(driver.gain * (1.0 + allowed.gain * off("gain")), -10.0, 10.0),
        limit=_within(driver.limit * (1.0 + allowed.limit * off("limit")), 0.0, 1.0),
        angle=_within(driver.angle + allowed.tilt * off("tilt"), -np.pi, np.pi),
    )


def _gains(pickups: Pickups, share: float, seed: int, name: str) -> tuple[float, float]:
    first, second = (
        _within(gain * (1.0 + share * _normal(seed, f"{name} {i}")), 0.0, 1e4)
        for i, gain in enumerate(pickups.gain)
    )
    return first, second


def _pair(values: tuple[float, float], off: list[float]) -> tuple[float, float]:
    return _within(values[0] + off[0], 0.0, 1.0), _within(values[1] + off[1], 0.0, 1.0)


def _within(value: float, low: float, high: float) -> float:
    return float(min(high, max(low, value)))


def _normal(seed: int, name: str) -> float:
    """Return the draw of one quantity: normal, of unit deviation before its tails are cut off at `CUT`."""
    stream = np.random.default_rng([seed, crc32(name.encode())])
    while abs(value := float(stream.standard_normal())) > CUT:
        pass
    return value
