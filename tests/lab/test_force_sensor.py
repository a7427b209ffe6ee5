import numpy as np
import pytest

from monochord.lab.force_sensor import ContactHistory, SensorNoise, bandwidth_filter, wrench_of
from monochord.lab.plan import ForceSensor
from monochord.physics.materials import load_material

PLASTIC = load_material("plastic")


def contact(along: float, across: float, normal: float = 1.0) -> ContactHistory:
    one = np.ones(1)
    return ContactHistory(time=0.0 * one, normal=normal * one, along=along * one, across=across * one)


@pytest.mark.parametrize(("along", "across"), [(0.02, 0.0), (-0.02, 0.0), (0.0, 0.03), (0.01, -0.02)])
def test_friction_works_against_the_slide_within_the_cone(along: float, across: float) -> None:
    plain = ForceSensor(crosstalk=(0.0, 0.0))
    force = wrench_of(contact(along, across, 1.5), PLASTIC, plain)[0]
    assert force[0] * along + force[1] * across < 0.0
    grip = np.hypot(force[0], force[1]) / 1.5
    assert 0.97 * PLASTIC.friction_kinetic <= grip <= PLASTIC.friction_static
    assert force[2] == 1.5


def test_the_torque_is_that_of_the_lever() -> None:
    sensor = ForceSensor(lever=0.05)
    force = wrench_of(contact(0.01, 0.02), PLASTIC, sensor)[0]
    np.testing.assert_allclose(force[3:], np.cross([0.0, 0.0, -0.05], force[:3]), atol=1e-12)


@pytest.mark.parametrize("bandwidth", [100.0, 500.0, 2000.0])
def test_the_filter_has_the_gain_of_a_mass_on_a_spring(bandwidth: float) -> None:
    taps = bandwidth_filter(bandwidth, 44100)
    np.testing.assert_allclose(taps, taps[::-1], rtol=0.0, atol=1e-15)
    frequency = np.array([0.2, 0.5, 1.0, 2.0, 4.0]) * bandwidth
    turn = np.exp(-2j * np.pi * np.outer(frequency, np.arange(taps.size)) / 44100.0)
    gain = np.abs(turn @ taps)
    np.testing.assert_allclose(gain, 1.0 / np.sqrt(1.0 + (frequency / bandwidth) ** 4), atol=0.01)


def test_noise_has_its_deviation_and_drift_its_bound() -> None:
    sensor = ForceSensor(noise=0.01, torque_noise=1e-3, drift=1e-3)
    time = np.linspace(0.0, 100.0, 20001)
    noise = SensorNoise(sensor, np.random.default_rng(1)).on(time)
    slope = np.polyfit(time, noise, 1)[0]
    assert (np.abs(slope[:3]) <= 1.05e-3).all()
    rest = noise - np.outer(time, slope)
    np.testing.assert_allclose(rest.std(axis=0), [0.01] * 3 + [1e-3] * 3, rtol=0.05)
    again = SensorNoise(sensor, np.random.default_rng(1))
    halves = np.concatenate([again.on(time[:7000]), again.on(time[7000:])])
    np.testing.assert_array_equal(halves, noise)
