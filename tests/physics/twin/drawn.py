"""Sensors and scenes drawn from all that the twin allows, by a seed."""

from dataclasses import replace

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import StringParams
from monochord.physics.materials import Material
from monochord.physics.setup import MAX_END_SHARE
from monochord.physics.theory import Losses
from monochord.physics.twin import (
    ContactLaw,
    Ebow,
    End,
    Key,
    Mount,
    MountMode,
    Outside,
    Pickups,
    Pluck,
    Scene,
    Sensor,
    Touch,
    Twin,
    begin,
)
from monochord.physics.twin.rate import HALF_SIZES, TOP_FREQUENCIES, mode_count, padded

Draw = np.random.Generator
MIN_LENGTH = 0.02
"""A flat object is not drawn wider than half of this, in m."""


def log_uniform(rng: Draw, low: float, high: float) -> float:
    return float(np.clip(np.exp(rng.uniform(np.log(low), np.log(high))), low, high))


def either(rng: Draw, low: float, high: float) -> float:
    """A value of a range, one of its ends now and then."""
    return float(rng.choice([low, high])) if rng.random() < 0.15 else float(rng.uniform(low, high))


def string(rng: Draw) -> StringParams:
    return StringParams(
        length=log_uniform(rng, 0.05, 2.0),
        linear_density=log_uniform(rng, 1e-5, 0.05),
        tension=log_uniform(rng, 2.0, 500.0),
        core_diameter=0.0 if rng.random() < 0.15 else log_uniform(rng, 1e-5, 3e-3),
        young_modulus=log_uniform(rng, 1e9, 1e12),
        tension_per_force=either(rng, 0.0, 20.0),
    )


def sensor(rng: Draw, string: StringParams) -> Sensor:
    near, far = sorted(rng.uniform(0.05, 0.95, 2) * string.length)
    drift = min(50.0, 0.25 * string.tension)
    drivers = [
        Ebow(
            sense=float(rng.uniform(0.001, 0.999)) * string.length,
            drive=float(rng.uniform(0.001, 0.999)) * string.length,
            aperture=either(rng, 0.0, 0.05),
            centre=log_uniform(rng, 20.0, 12000.0),
            quality=log_uniform(rng, 0.1, 20.0),
            gain=either(rng, -10.0, 10.0),
            limit=either(rng, 0.0, 1.0),
            angle=float(rng.uniform(-np.pi, np.pi)),
        )
        for _ in range(2)
    ]
    return Sensor(
        name="drawn",
        string=string,
        drivers=(drivers[0], drivers[1]),
        range=(float(near), float(far)),
        losses=Losses(
            viscoelastic=either(rng, 0.0, 0.05),
            thermoelastic=either(rng, 0.0, 0.01),
            support=either(rng, 0.0, 0.05),
        ),
        pickups=Pickups(
            own=(either(rng, 0.0, 1.0), either(rng, 0.0, 1.0)),
            gain=(log_uniform(rng, 1e-3, 1e4), log_uniform(rng, 1e-3, 1e4)),
            angle=float(rng.uniform(-np.pi, np.pi)),
            low=log_uniform(rng, 1.0, 1000.0),
            high=log_uniform(rng, 1000.0, 20000.0),
            hiss=either(rng, 0.0, 0.1),
        ),
        drift=either(rng, -drift, drift),
        drift_rate=either(rng, -1.0, 1.0),
        shake=either(rng, 0.0, 100.0),
    )


def material(rng: Draw) -> Material:
    """From foam to steel."""
    kinetic = log_uniform(rng, 0.01, 2.0)
    return Material(
        name="drawn",
        title="",
        source="",
        young_modulus=log_uniform(rng, 1e3, 2e12),
        poisson_ratio=either(rng, 1e-3, 0.5),
        loss=log_uniform(rng, 1e-4, 10.0),
        friction_static=kinetic * float(rng.uniform(1.0, 2.5)),
        friction_kinetic=kinetic,
        stribeck_speed=log_uniform(rng, 1e-5, 1.0),
        roughness=log_uniform(rng, 1e-9, 1e-3),
        roughness_length=log_uniform(rng, 1e-7, 1e-2),
        radius=log_uniform(rng, 1e-4, 1.0),
    )


def touch(rng: Draw, length: float, seconds: float) -> Touch:
    times = np.sort(rng.uniform(0.0, seconds, int(rng.integers(1, 7))))
    times += 1e-3 * np.arange(times.size)
    place = float(rng.uniform(0.02, 0.98)) * length
    keys: list[Key] = []
    for time in times:
        reach = 4.9 * (time - keys[-1].time) if keys else 0.0
        place = float(
            np.clip(place + rng.choice([0.0, 1.0]) * rng.uniform(-reach, reach), 0.02 * length, 0.98 * length)
        )
        pressing = rng.random() < 0.8
        force = either(rng, 0.0, 10.0) if pressing else 0.0
        clearance = 0.0 if pressing else log_uniform(rng, 1e-6, 0.1)
        across = float(rng.choice([0.0, either(rng, -0.5, 0.5)]))
        keys.append(Key(time=float(time), position=place, force=force, clearance=clearance, across=across))
    radius = None if rng.random() < 0.3 else log_uniform(rng, 2e-4, 1.0)
    return Touch(material=material(rng), motion=tuple(keys), radius=radius, rolls=bool(rng.random() < 0.5))


def scene(rng: Draw, length: float, seconds: float) -> Scene:
    touches = [touch(rng, length, seconds) for _ in range(int(rng.choice([0, 1, 1, 1, 2, 3, 8])))]
    if len(touches) > 1 and rng.random() < 0.5:  # two at the same place
        same = [replace(key, position=touches[0].motion[0].position) for key in touches[1].motion]
        touches[1] = replace(touches[1], motion=tuple(same))
        touches[0] = replace(touches[0], motion=touches[0].motion[:1])
    outside = Outside(
        samples=rng.uniform(-1.0, 1.0, 3000).astype(np.float32), level=log_uniform(rng, 1e-3, 1e3)
    )
    pluck = Pluck(
        position=float(rng.uniform(0.01, 0.99)) * length,
        height=either(rng, -2e-3, 2e-3),
        angle=float(rng.uniform(-np.pi, np.pi)),
    )
    return Scene(
        touches=tuple(touches),
        outside=outside if rng.random() < 0.3 else None,
        pluck=pluck if rng.random() < 0.7 else None,
        drivers=(bool(rng.random() < 0.7), bool(rng.random() < 0.7)),
        tension_law="geometric" if rng.random() < 0.7 else "linear",
    )


def end(rng: Draw, string: StringParams) -> End:
    most = MAX_END_SHARE / (string.tension * string.linear_density) ** 0.5
    return End(
        compliance=either(rng, 0.0, min(2e-5, 0.0099 * string.length / string.tension)),
        admittance=either(rng, 0.0, min(0.05, 0.99 * most)),
        frequency=log_uniform(rng, 20.0, 12000.0),
        quality=log_uniform(rng, 0.1, 100.0),
    )


def with_effects(rng: Draw, sensor: Sensor) -> Sensor:
    """The same sensor with every effect of the world `plausible`, as strong as it may be."""
    string = sensor.string
    drivers = [
        replace(
            driver,
            level=log_uniform(rng, 0.05, 20.0),
            bias=either(rng, -1.0, 1.0),
            pull=either(
                rng, 0.0, min(500.0, 1.99 * string.tension / string.length)
            ),  # the string is softest in its middle
        )
        for driver in sensor.drivers
    ]
    pickups = replace(
        sensor.pickups,
        distortion=(either(rng, -0.01, 0.01), either(rng, -0.01, 0.01)),
        hum=(either(rng, 0.0, 0.1), either(rng, 0.0, 0.1)),
        mains=either(rng, 45.0, 65.0),
        feed=(either(rng, -1e3, 1e3), either(rng, -1e3, 1e3)),
        residual=True,
    )
    return replace(
        sensor,
        drivers=(drivers[0], drivers[1]),
        pickups=pickups,
        ends=(end(rng, string), end(rng, string)),
        press_tension=either(rng, 0.0, 20.0),
    )


def held(rng: Draw, touch: Touch) -> Touch:
    """The same touch with a mount, another law and a rough layer."""
    modes = tuple(
        MountMode(
            mass=log_uniform(rng, 1e-4, 1.0),
            frequency=log_uniform(rng, 20.0, 8000.0),
            quality=log_uniform(rng, 1.0, 1e3),
        )
        for _ in range(int(rng.integers(0, 4)))
    )
    law = ContactLaw(
        exponent=either(rng, 1.0, 1.5),
        flat=None if rng.random() < 0.7 else log_uniform(rng, 2e-4, min(1e-2, 0.5 * MIN_LENGTH)),
        layer=either(rng, 0.0, 1e-4),
        layer_load=log_uniform(rng, 1e-4, 1.0),
        width=0.0 if rng.random() < 0.5 else log_uniform(rng, 1e-5, 0.5 * MIN_LENGTH),
        arm=0.0 if rng.random() < 0.5 else log_uniform(rng, 1e-4, 10.0),
    )
    return replace(touch, mount=Mount(modes=modes, compliance=either(rng, 0.0, 1e-3)), law=law)


def plausible_twin(seed: int, seconds: float, halves: tuple[int, ...] = HALF_SIZES) -> Twin:
    """A drawn twin with all effects of the world `plausible`; those that are refused are drawn again."""
    drawn, rng = seed, np.random.default_rng([seed, 1])
    while True:
        ideal = twin(drawn, seconds, halves)
        try:
            sensor = with_effects(rng, ideal.sensor)
            touches = tuple(held(rng, touch) for touch in ideal.scene.touches)
            scene = replace(ideal.scene, touches=touches)
            return begin(sensor, scene, sample_rate=ideal.sample_rate, seed=seed)
        except InputError:
            drawn += 7919


def twin(
    seed: int,
    seconds: float,
    halves: tuple[int, ...] = HALF_SIZES,
    rates: tuple[int, ...] = (16000, 44100, 48000, 96000, 192000),
) -> Twin:
    """A twin of the allowed domain whose half bank has one of the sizes; all others are drawn again."""
    rng = np.random.default_rng(seed)
    while True:
        wire, rate = string(rng), int(rng.choice(rates))
        if mode_count(wire, rate, TOP_FREQUENCIES[0]) > max(
            halves
        ):  # it has no fewer modes once it is planned
            continue
        try:
            built = sensor(rng, wire)
            found = begin(built, scene(rng, wire.length, seconds), sample_rate=rate, seed=seed)
        except InputError:
            continue
        if padded(found.plan.count) in halves:
            return found
