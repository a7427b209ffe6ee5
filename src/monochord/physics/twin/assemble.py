"""From a sensor and a scene in the field's terms to the arrays that the kernel runs on."""

from math import cos, pi, sin, tan
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz
from monochord.physics.theory import (
    bending_stiffness,
    contact_width,
    decay_rates,
    hertz_stiffness,
    mindlin_ratio,
    static_compliance,
    stretch_stiffness,
)
from monochord.physics.twin.bank import (
    BEND,
    DRIVE_1,
    END_1,
    END_2,
    FRAME,
    PULL,
    SENSE_1,
    SIGMA,
    STRETCH,
    rows,
)
from monochord.physics.twin.rate import Plan, mode_frequencies, padded, touch_weights
from monochord.physics.twin.setup import Ebow, Pluck, Scene, Sensor, Touch

TABLE = 513
"""Entries of a table of compliance along the string."""
WIDE = 400
"""How many modes tell what a touch's width takes from its compliance."""
USUAL_FORCE = 1.0
"""Press in N at which the width of a touch is taken."""

Arrays = dict[str, Any]


def sensor_arrays(
    sensor: Sensor, scene: Scene, plan: Plan, rate: Hertz, seed: int, agreement: float
) -> Arrays:
    """Return the fixed arrays of one sensor, by the names of the kernel's `Sensor`, without the touches."""
    string, step = sensor.string, 1.0 / (rate * plan.finer)
    half, count = padded(plan.count), plan.count
    omega = mode_frequencies(string, count)
    n = np.arange(1, count + 1)
    wave = n * pi / string.length
    turn = omega * step
    stretch = n**2 * np.minimum(turn / np.sin(turn), 1.0 / np.sin(0.5 * turn) ** 2)
    sigma = decay_rates(string, sensor.losses, omega / (2.0 * pi))
    if (sigma >= 0.9 * omega).any():
        raise InputError(f"sensor {sensor.name}: losses", "modes that ring", "lower the loss factors")
    bank = np.zeros((rows(0), 2 * half))
    for first, share in ((0, cos), (half, sin)):
        own = slice(first, first + count)
        bank[PULL, own] = wave**2 / string.linear_density
        bank[BEND, own] = bending_stiffness(string) * wave**4 / string.linear_density
        bank[SIGMA, own] = sigma
        bank[STRETCH, own] = stretch
        for d, driver in enumerate(sensor.drivers):
            blur = np.exp(-0.5 * (wave * driver.aperture) ** 2) * share(driver.angle)
            bank[DRIVE_1 + d, own] = np.sin(wave * driver.drive) * blur
            bank[SENSE_1 + d, own] = np.sin(wave * driver.sense) * blur
        felt = (string.tension + bending_stiffness(string) * wave**2) * wave * share(sensor.pickups.angle)
        bank[END_1, own] = felt
        bank[END_2, own] = -felt * np.cos(n * pi)
    bank[FRAME, :count] = -string.linear_density * (1.0 - np.cos(n * pi)) / wave
    linear = scene.tension_law == "linear"
    axial = stretch_stiffness(string)
    scalars = [
        step,
        string.length,
        string.tension,
        0.5 * string.linear_density * string.length,
        pi**2 / (4.0 * string.length),
        0.0 if linear else axial * pi**2 / (4.0 * string.length**2),
        axial,
        string.tension_per_force,
        sensor.drift,
        sensor.drift_rate,
        sensor.shake,
        agreement,
    ]
    return {
        "scalars": np.array(scalars),
        "integers": np.array([plan.finer, seed, int(linear)], dtype=np.int64),
        "bank": bank,
        "ebows": np.array([_ebow(driver, step) for driver in sensor.drivers]),
        "pickup": _pickup(sensor, rate),
        "gates": np.array(scene.drivers, dtype=np.float64),
        "sound": _outside(scene),
    }


def touch_arrays(sensor: Sensor, touches: tuple[Touch, ...], plan: Plan, rate: Hertz) -> Arrays:
    """Return the fixed arrays of the touches, by the names of the kernel's `Sensor`."""
    string, step = sensor.string, 1.0 / (rate * plan.finer)
    half = padded(plan.count)
    omega = mode_frequencies(string, plan.count)
    most = max((len(touch.motion) for touch in touches), default=1)
    arrays: Arrays = {
        "touches": np.zeros((len(touches), 10)),
        "keys": np.zeros((len(touches), most, 5)),
        "counts": np.array([len(touch.motion) for touch in touches], dtype=np.int64),
        "weights": np.zeros((len(touches), half)),
        "tables": np.zeros((len(touches), TABLE)),
    }
    held = np.sqrt(touch_weights(omega, step, plan.beta))
    for t, touch in enumerate(touches):
        material = touch.material
        radius = touch.radius if touch.radius is not None else material.radius
        elastic = (radius, material.young_modulus, material.poisson_ratio)
        _refuse_outside(touch, sensor)
        arrays["touches"][t] = (
            0.0,
            hertz_stiffness(string, *elastic),
            material.loss,
            mindlin_ratio(material.poisson_ratio),
            material.friction_static,
            material.friction_kinetic,
            material.stribeck_speed,
            material.roughness,
            material.roughness_length,
            float(touch.rolls),
        )
        for k, key in enumerate(touch.motion):
            arrays["keys"][t, k] = (key.time, key.position, key.force, key.clearance, key.across)
        width = float(contact_width(string, *elastic, USUAL_FORCE))
        arrays["weights"][t, : plan.count] = held * _blur(string.length, width, plan.count)
        arrays["tables"][t] = _compliance(sensor, width)
    return arrays


def plucked(sensor: Sensor, pluck: Pluck | None, plan: Plan) -> Floats:
    """Return the displacement of every mode of the bank at the start, in m."""
    half = padded(plan.count)
    q = np.zeros(2 * half)
    if pluck is None:
        return q
    length, place = sensor.string.length, pluck.position
    if not 0.0 < place < length:
        raise InputError(f"a pluck at {place:g} m", f"between 0 and {length:g} m")
    n = np.arange(1, plan.count + 1)
    share = np.sin(n * pi * place / length) * length**2 / (place * (length - place))
    triangle = 2.0 * pluck.height * share / (n * pi) ** 2
    q[: plan.count] = triangle * cos(pluck.angle)
    q[half : half + plan.count] = triangle * sin(pluck.angle)
    return q


def _ebow(driver: Ebow, step: float) -> tuple[float, ...]:
    g, k = tan(pi * min(driver.centre * step, 0.45)), 1.0 / driver.quality
    gain = driver.gain / driver.limit if driver.limit > 0.0 else 0.0
    return g, k, gain, driver.limit, 1.0 / (1.0 + g * (g + k))


def _pickup(sensor: Sensor, rate: Hertz) -> Floats:
    pickups, low = sensor.pickups, tan(pi * sensor.pickups.low / rate)
    g = tan(pi * min(pickups.high, 0.45 * rate) / rate)
    return np.array(
        [
            *pickups.own,
            *pickups.gain,
            low / (1.0 + low),
            g,
            2.0**0.5,
            pickups.hiss,
            *pickups.air,
            1.0 / (1.0 + g * (g + 2.0**0.5)),
        ]
    )


def _outside(scene: Scene) -> Audio:
    if scene.outside is None:
        return np.zeros(0, dtype=np.float32)
    samples = np.asarray(scene.outside.samples, dtype=np.float32)
    if samples.ndim != 1 or samples.size == 0 or not np.isfinite(samples).all():
        raise InputError(f"an outside sound of shape {samples.shape}", "finite mono samples, (n,)")
    return samples * np.float32(scene.outside.level)


def _refuse_outside(touch: Touch, sensor: Sensor) -> None:
    length = sensor.string.length
    edge = 0.02 * length
    for key in touch.motion:
        if not edge <= key.position <= length - edge:
            raise InputError(f"a touch at {key.position:g} m", f"{edge:g} to {length - edge:g} m")


def _blur(length: float, width: float, count: int) -> Floats:
    """Share of each mode that a touch feels which spreads over a width (a Gaussian of its variance)."""
    wave = np.arange(1, count + 1) * pi / length
    return np.exp(-((wave * width) ** 2) / 24.0)


def _compliance(sensor: Sensor, width: float) -> Floats:
    """Return the static compliance along the string, in m/N, of a touch that spreads over a width."""
    string = sensor.string
    place = np.linspace(0.0, 1.0, TABLE)
    inside = np.zeros(TABLE)
    inside[1:-1] = static_compliance(string, place[1:-1] * string.length)
    omega = mode_frequencies(string, WIDE)
    taken = (1.0 - _blur(string.length, width, WIDE) ** 2) * 2.0
    taken /= string.linear_density * string.length * omega**2
    return inside - np.sin(np.outer(place, np.arange(1, WIDE + 1)) * pi) ** 2 @ taken
