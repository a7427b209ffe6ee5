"""Builds and days: spread as stated, by seed alone, each touching only what it may."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.setup import Changes, Tolerances
from monochord.physics.theory import open_frequency
from monochord.physics.twin import Sensor
from monochord.physics.twin.variation import TRUNCATION, build, day, tension_per_kelvin

DESIGN = load_sensor("prototype")
MANY = [build(DESIGN, seed) for seed in range(400)]
DAYS = [day(DESIGN, seed) for seed in range(400)]
LEFT = 0.955
"""Deviation of a unit normal cut at 2.5: the root of 1 - 2 c phi(c) / (2 Phi(c) - 1)."""


def drawn(sensors: list[Sensor], of: Callable[[Sensor], float]) -> np.ndarray:
    return np.array([of(one) for one in sensors])


def assert_spread(values: np.ndarray, mean: float, deviation: float) -> None:
    # Of 400: the mean's error is 5 % of the deviation and the deviation's 3.5 %; both within four of them.
    assert abs(values.mean() - mean) < 0.2 * deviation
    assert values.std() == pytest.approx(LEFT * deviation, rel=0.14)
    assert np.abs(values - mean).max() < (TRUNCATION + 0.1) * deviation


@pytest.mark.parametrize(
    ("of", "mean", "deviation"),
    [
        (lambda s: s.string.core_diameter, 2.54e-4, 2.54e-6),
        (lambda s: s.string.length, 0.2, 2.5e-4),
        (lambda s: 1200.0 * np.log2(open_frequency(s.string) / 1010.565), 0.0, 10.0),
        (lambda s: s.drivers[0].sense, 0.015, 5e-4),
        (lambda s: s.drivers[1].drive, 0.189, 5e-4),
        (lambda s: s.drivers[0].gain, 0.06, 0.006),
        (lambda s: s.drivers[1].limit, 2e-3, 2e-4),
        (lambda s: s.drivers[0].centre, 900.0, 45.0),
        (lambda s: s.drivers[0].angle, 0.2, 0.05),
        (lambda s: s.pickups.gain[0], 2.0, 0.24),
        (lambda s: s.pickups.own[1], 0.85, 0.03),
        (lambda s: s.losses.support, 4e-3, 8e-4),
    ],
)
def test_builds_spread_as_the_tolerances_say(
    of: Callable[[Sensor], float], mean: float, deviation: float
) -> None:
    assert_spread(drawn(MANY, of), mean, deviation)


@pytest.mark.parametrize(
    ("of", "mean", "deviation"),
    [
        (lambda s: s.drivers[1].gain, 0.06, 0.003),
        (lambda s: s.drivers[0].limit, 2e-3, 1e-4),
        (lambda s: s.pickups.gain[1], 2.0, 0.07),
        (lambda s: s.drift_rate, 0.0, 0.1145 * 1.5 / 3600.0),
    ],
)
def test_days_spread_as_the_changes_say(of: Callable[[Sensor], float], mean: float, deviation: float) -> None:
    assert_spread(drawn(DAYS, of), mean, deviation)


def test_days_move_the_tension_by_their_temperature() -> None:
    warm = replace(DESIGN, changes=Changes(creep=0.0))
    assert_spread(drawn([day(warm, seed) for seed in range(400)], lambda s: s.drift), 0.0, 3.0 * 0.1145)
    cool = drawn(
        [day(replace(DESIGN, changes=Changes(temperature=0.0)), seed) for seed in range(50)],
        lambda s: s.drift,
    )
    assert (cool < 0.0).all()  # creep only slackens


def test_a_kelvin_on_steel_over_aluminium_is_a_tenth_of_a_newton() -> None:
    # E A (alpha_Al - alpha_steel) = 200e9 pi/4 (0.254e-3)^2 (23e-6 - 11.7e-6)
    assert tension_per_kelvin(DESIGN) == pytest.approx(10134.1 * 11.3e-6, rel=1e-4)
    assert tension_per_kelvin(replace(DESIGN, frame_expansion=0.0)) < 0.0


def test_density_stretch_and_tension_go_with_the_wire() -> None:
    for one in MANY[:20]:
        thick = (one.string.core_diameter / DESIGN.string.core_diameter) ** 2
        assert one.string.linear_density == pytest.approx(thick * DESIGN.string.linear_density)
    tension = drawn(MANY, lambda s: s.string.tension)
    thickness = drawn(MANY, lambda s: s.string.core_diameter)
    assert np.corrcoef(tension, thickness)[0, 1] > 0.8  # tuned to a pitch, a thicker wire is tighter


def test_streams_are_independent() -> None:
    no_gain = build(replace(DESIGN, tolerances=Tolerances(gain=0.0)), 5)
    usual = build(DESIGN, 5)
    assert no_gain.drivers[0].gain == DESIGN.drivers[0].gain
    assert no_gain.string == usual.string
    assert no_gain.drivers[0].sense == usual.drivers[0].sense
    columns = np.array(
        [[s.drivers[0].gain, s.drivers[1].gain, s.drivers[0].sense, s.string.length] for s in MANY]
    )
    off = np.corrcoef(columns.T) - np.eye(4)
    assert np.abs(off).max() < 0.2  # four times 1 / sqrt(400)


def test_without_tolerances_nothing_but_the_name_changes() -> None:
    none = Tolerances(
        diameter=0.0, tuning=0.0, length=0.0, places=0.0, aperture=0.0, gain=0.0, limit=0.0, centre=0.0,
        quality=0.0, tilt=0.0, pickup_gain=0.0, own=0.0, losses=0.0,
    )  # fmt: skip
    exact = replace(DESIGN, tolerances=none)
    assert replace(build(exact, 9), name=exact.name) == exact


def test_a_day_changes_only_what_a_day_may_change() -> None:
    built = build(DESIGN, 2)
    for seed in range(20):
        later = day(built, seed)
        restored = replace(
            later,
            name=built.name,
            drift=built.drift,
            drift_rate=built.drift_rate,
            drivers=(
                replace(later.drivers[0], gain=built.drivers[0].gain, limit=built.drivers[0].limit),
                replace(later.drivers[1], gain=built.drivers[1].gain, limit=built.drivers[1].limit),
            ),
            pickups=replace(later.pickups, gain=built.pickups.gain),
        )
        assert restored == built


@pytest.mark.parametrize("name", sensor_names())
def test_the_widest_tolerances_still_give_sensors(name: str) -> None:
    widest = Tolerances(
        diameter=0.3, tuning=100.0, length=0.005, places=0.005, aperture=0.3, gain=0.3, limit=0.3, centre=0.3,
        quality=0.3, tilt=0.3, pickup_gain=0.3, own=0.1, losses=0.3,
    )  # fmt: skip
    worst = replace(load_sensor(name), tolerances=widest, changes=Changes(temperature=30.0, creep=5.0))
    for seed in range(10):
        assert day(build(worst, seed), seed).string.linear_density > 0.0  # refused otherwise, as it is made
