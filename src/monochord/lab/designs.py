"""Random sensor designs: the same string with other drivers and microphones, as other labs might build it."""

from dataclasses import replace

import numpy as np

from monochord.lab.objects import evenly
from monochord.physics.setup import Ebow, Sensor

ALIKE = 0.5
"""Share of designs with two identical drivers."""
LOWEST, HIGHEST = 600.0, 5000.0
"""Centre frequency of a driver's band, in Hz."""


def drawn_design(sensor: Sensor, random: np.random.Generator) -> Sensor:
    """Return a sensor with the same string and random drivers, microphones and frame.

    All ranges are assumed. Each driver's coils are at 4 to 20 % of the length from its end, in either order.
    In half of the designs both drivers are of one make: they share band, gain, limit and width; in the others
    each driver has its own. The microphones' gains and the frame's crosstalk and losses are random too.

    >>> from monochord.physics.sensors import load_sensor
    >>> prototype = load_sensor("prototype")
    >>> other = drawn_design(prototype, np.random.default_rng(1))
    >>> other == drawn_design(prototype, np.random.default_rng(1)), other.string == prototype.string
    (True, True)
    """
    between, length = evenly(random), sensor.string.length
    alike = random.uniform() < ALIKE
    makes = [_make(sensor.drivers[0], random)]
    makes.append(makes[0] if alike else _make(sensor.drivers[1], random))
    coils = [length * np.sort(random.uniform(0.04, 0.12) + np.array([0.0, random.uniform(0.04, 0.08)]))
             for _ in makes]  # fmt: skip
    first, second = (random.permutation(each).tolist() for each in coils)
    pickups, losses = sensor.pickups, sensor.losses
    return replace(
        sensor,
        name=f"{sensor.name}_drawn",
        drivers=(
            replace(makes[0], sense=first[0], drive=first[1]),
            replace(makes[1], sense=length - second[0], drive=length - second[1]),
        ),
        pickups=replace(
            pickups,
            own=(float(random.uniform(0.7, 0.95)), float(random.uniform(0.7, 0.95))),
            gain=(between(0.5, 2.0) * pickups.gain[0], between(0.5, 2.0) * pickups.gain[1]),
            angle=float(random.uniform(0.2, 0.8)),
        ),
        losses=replace(losses, support=between(0.4, 2.0) * losses.support),
    )


def _make(driver: Ebow, random: np.random.Generator) -> Ebow:
    """Return a driver of another make, with its coils in the same place."""
    between = evenly(random)
    return replace(
        driver,
        centre=between(LOWEST, HIGHEST),
        quality=between(0.4, 1.0),
        gain=between(0.5, 2.0) * driver.gain,
        limit=between(0.5, 2.0) * driver.limit,
        aperture=between(3e-3, 8e-3),
        angle=float(random.uniform(0.0, 0.4)),
    )
