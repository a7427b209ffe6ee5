"""The twin as a simulator: a whole driven string with one touch."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from monochord.core.config import from_tree, override, to_tree
from monochord.core.errors import InputError
from monochord.core.types import Contact, Floats, StringParams
from monochord.core.units import Hertz, Metres, MetresPerSecond, Samples, Seconds
from monochord.dsp.spectrum import Analyser
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.simulators.base import Case, Simulator, Sound, expected_peaks
from monochord.physics.theory import TensionLaw, mixing_matrix, open_frequency
from monochord.physics.twin import Ebow, Key, Pluck, Scene, Sensor, Take, Touch, advance, begin
from monochord.physics.twin.world import World, plausible_build, plausible_touch

START_CLEARANCE: Metres = 1e-3
"""Initial height of the object above the string, in m."""
CONTACT_TIME: Seconds = 0.02
"""Time when the object reaches the string at rest, in s."""
PRESS_TIME: Seconds = 0.02
"""Rise time of the force, in s."""
MIN_SECONDS: Seconds = 0.01
MAX_SECONDS: Seconds = 600.0
"""Shortest sound with resolvable peaks, and longest sound held in memory, in s."""
MIN_SALIENCE = 8.0
"""Smallest height of a peak over the noise floor, in nepers of power."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinCase:
    """The twin's setup for a case, which assignments override.

    The string stands in `sensor`, see `monochord.physics.twin.Sensor`. `material` is a preset's name or file,
    `across` the speed in m/s at which the object moves across the string, `drivers` which are on, and `pluck`
    the initial shape of the string. `world` is "ideal" or "plausible", whose effects are drawn by `seed`.
    """

    sensor: Sensor
    contact: Contact | None = None
    tension_law: TensionLaw = "geometric"
    material: str = "plastic"
    across: MetresPerSecond = 0.0
    drivers: tuple[bool, bool] = (True, True)
    pluck: Pluck | None = None
    seed: int = 0
    world: World = "ideal"


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinSimulator(Simulator):
    """The virtual sensor: `monochord.physics.twin`, plucked and touched from the start.

    A touch of 0 N rests against the string and does not divide it.

    Parameters
    ----------
    tension_law
        How force raises tension: "geometric", the stretch of the deflected string, or "linear", the paper's.
    sample_rate
        Sample rate of the sound, in Hz.
    """

    tension_law: TensionLaw = "geometric"
    sample_rate: int = 44100

    @classmethod
    def setup(cls) -> type:
        """Return the dataclass of the setup."""
        return TwinCase

    def run(self, case: Case) -> Sound:
        """Simulate, and find the strongest line on each side of the touch after the transient."""
        if not MIN_SECONDS <= case.seconds <= MAX_SECONDS:
            raise InputError(f"{case.seconds:g} seconds", f"{MIN_SECONDS:g} to {MAX_SECONDS:g} s")
        plain = TwinCase(
            sensor=sensor_of(case.string),
            contact=case.contact,
            tension_law=self.tension_law,
            pluck=Pluck(position=0.15 * case.string.length, height=5e-4 * case.string.length),
        )
        setup = from_tree(TwinCase, override(to_tree(plain), case.assignments))
        take = _simulate(setup, round(case.seconds * self.sample_rate), self.sample_rate)
        late = _after_the_transient(take)
        theory = expected_peaks(setup.sensor.string, setup.contact, setup.tension_law)
        measured = _peaks(take.microphones[:, late:], setup.sensor, self.sample_rate)
        summary: dict[str, Any] = {
            "position": setup.contact.position if setup.contact else None,
            "force": setup.contact.force if setup.contact else None,
            "peaks": measured,
            "theory": list(theory),
            "partials": [_partial(peak, base) for peak, base in zip(measured, theory, strict=True)],
            "sensor": setup.sensor.name,
            "material": setup.material if setup.contact else None,
            "tension_law": setup.tension_law,
            **_label_means(take, late),
        }
        microphones = take.microphones.astype(np.float64)
        return Sound(microphones=microphones, sample_rate=self.sample_rate, summary=summary)


def sensor_of(string: StringParams) -> Sensor:
    """Return the sensor preset with this string, or else a sensor built for the string.

    A built sensor is the prototype with this string: drivers and sensing range at the same shares of the
    length, the drivers' band scaled with the open frequency, their gain with the string's impedance sqrt(T
    mu) and their limit with its tension, so that they sustain it equally well. All of that is assumed.

    Raises
    ------
    InputError
        If no sensor can be built for the string.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> sensor_of(load_string("prototype").string).name
    'prototype'
    >>> sensor_of(load_string("appendix").string).range
    (0.1625, 0.4875)
    """
    for sensor in map(load_sensor, sensor_names()):
        if sensor.string == string:
            return sensor
    model = load_sensor("prototype")
    share = string.length / model.string.length
    drivers = tuple(_fitted(driver, model.string, string) for driver in model.drivers)
    return replace(
        model,
        name="unnamed",
        title="A sensor made for a string",
        source="",
        notes="Drivers, range and pickups are the prototype's, fitted to the string; assumed.",
        string=string,
        drivers=(drivers[0], drivers[1]),
        range=(share * model.range[0], share * model.range[1]),
    )


def _fitted(driver: Ebow, old: StringParams, new: StringParams) -> Ebow:
    share = new.length / old.length
    pitch = open_frequency(new) / open_frequency(old)
    heavier = ((new.tension * new.linear_density) / (old.tension * old.linear_density)) ** 0.5
    return replace(
        driver,
        sense=share * driver.sense,
        drive=share * driver.drive,
        aperture=min(0.05, share * driver.aperture),
        centre=min(12000.0, max(20.0, pitch * driver.centre)),
        gain=min(10.0, max(-10.0, heavier * driver.gain)),
        limit=min(1.0, new.tension / old.tension * driver.limit),
    )


def _simulate(setup: TwinCase, frames: Samples, rate: int) -> Take:
    touches: tuple[Touch, ...] = ()
    if setup.contact is not None:
        place, force = setup.contact.position, setup.contact.force
        motion = (
            Key(time=0.0, position=place, clearance=START_CLEARANCE),
            Key(time=CONTACT_TIME, position=place),
            Key(time=CONTACT_TIME + PRESS_TIME, position=place, force=force, across=setup.across),
        )
        touches = (Touch(material=load_material(setup.material), motion=motion),)
    sensor = setup.sensor
    if setup.world != "ideal":
        sensor = plausible_build(sensor, setup.seed)
    touches = tuple(plausible_touch(touch, setup.seed, world=setup.world) for touch in touches)
    scene = Scene(touches=touches, pluck=setup.pluck, drivers=setup.drivers, tension_law=setup.tension_law)
    return advance(begin(sensor, scene, sample_rate=rate, seed=setup.seed), frames)[0]


def _after_the_transient(take: Take) -> Samples:
    """Return the first settled frame, never one in the second half."""
    unsettled = np.flatnonzero(take.labels.settled == 0)
    half = take.labels.settled.size // 2
    return min(int(unsettled[-1]) + 1, half) if unsettled.size else 0


def _label_means(take: Take, late: Samples) -> dict[str, float | None]:
    """Return means of the labels after the transient; without a touch, slip and force are None."""
    labels = take.labels
    means: dict[str, float | None] = {
        "settled": float(labels.settled[-1]),
        "transient": late / labels.settled.size,
        "contact": 0.0,
        "slip": None,
        "slip_velocity": None,
        "felt": None,
    }
    if labels.contact.shape[0]:
        speeds = np.hypot(labels.across[0, late:], labels.along[0, late:])
        means |= {
            "contact": float(labels.contact[0, late:].mean()),
            "slip": float(labels.slip[0, late:].mean()),
            "slip_velocity": float(speeds.mean()),
            "felt": float(labels.force[0, late:].mean()),
        }
    return means


def _peaks(microphones: np.ndarray, sensor: Sensor, rate: int) -> list[Hertz | None]:
    """Return the strongest line at each end, with the microphones' mixing inverted; None for a silent end."""
    mixing = mixing_matrix(*sensor.pickups.own)
    if abs(np.linalg.det(mixing)) < 1e-6 or min(sensor.pickups.gain) == 0.0:
        raise InputError(
            f"pickups.own {sensor.pickups.own}", "two microphones that pick up the ends differently"
        )
    gains = np.array(sensor.pickups.gain)[:, None]
    ends: Floats = np.linalg.inv(mixing).astype(np.float64) @ (microphones / gains)
    analyser = Analyser(sample_rate=rate, size=ends.shape[1], top=0.45 * rate)
    return [_strongest(analyser, power) for power in analyser.powers(ends)]


def _strongest(analyser: Analyser, power: Floats) -> Hertz | None:
    peaks = analyser.peaks(power, analyser.salience(power), MIN_SALIENCE)
    return float(peaks.frequency[peaks.power.argmax()]) if peaks.power.size else None


def _partial(peak: Hertz | None, base: Hertz) -> int | None:
    return None if peak is None else max(1, round(peak / base))
