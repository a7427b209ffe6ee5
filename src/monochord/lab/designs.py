"""Designs that are drawn: the same string with other drivers and microphones, as other labs build it."""

from dataclasses import replace

import numpy as np

from monochord.lab.objects import evenly
from monochord.physics.twin.setup import Ebow, Sensor

ALIKE = 0.5
"""Share of designs whose two drivers are of one make."""
LOWEST, HIGHEST = 600.0, 5000.0
"""Centre of a driver's band in Hz."""


def drawn_design(sensor: Sensor, random: np.random.Generator) -> Sensor:
    """Return a sensor with the same string, whose drivers, microphones and frame are drawn.

    All ranges are assumed. Each driver's coils are at 4 to 20 % of the length from its end, in either order;
    band, gain, limit and width are drawn for both together in half of the designs, which have two drivers of
    one make, and for each by itself in the others. The microphones' gains, the share of the frame's crosstalk
    and its losses are drawn, too.

    Examples
    --------
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
    """Return a driver of a make of its own, whose coils are where they were."""
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
