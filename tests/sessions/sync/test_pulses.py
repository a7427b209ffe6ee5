"""Taps in a force and in a height: what is a tap, what is not, and when it was."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.sessions.sync.pulses import Taps, dip, groups_of, middle_of_dip, taps_of_force, taps_of_height


def pulses(time: Floats, *at: float, length: float = 0.006, peak: float = 1.0) -> Floats:
    """Triangles of force that begin at some times, with the step that a string's inertia gives."""
    force = np.zeros(time.size)
    for begin in at:
        inside = (time >= begin) & (time < begin + length)
        force[inside] += 0.08 + peak * (1.0 - np.abs(2.0 * (time[inside] - begin) / length - 1.0))
    return force


def readings(rate: float, seconds: float = 6.0) -> Floats:
    return np.arange(0.3 / rate, seconds, 1.0 / rate)


@pytest.mark.parametrize(("rate", "peak"), [(1000.0, 2.0), (7000.0, 0.3)])
def test_pulses_are_located_to_a_sampling_interval(rate: float, peak: float) -> None:
    rng = np.random.default_rng(0)
    time, at = readings(rate), np.array([1.0003, 1.4011, 2.0507, 4.9002])
    force = pulses(time, *at, peak=peak) + 0.01 * rng.standard_normal(time.size)
    taps = taps_of_force(time, force)
    assert len(taps) == 4
    assert np.abs(taps.begin - at).max() < 1.6 / rate
    assert np.abs(taps.middle - at - 0.003).max() < 1.6 / rate
    assert taps.spacing == pytest.approx(1.0 / rate)


def test_noise_of_a_sensor_that_repeated_values_for_long() -> None:
    time = readings(1000.0, 9.0)
    noise = 0.011 * np.random.default_rng(1).standard_normal(time.size)
    force = pulses(time, 5.5, 5.8, 6.2) + np.where(time < 4.5, 0.004, noise)
    assert len(taps_of_force(time, force)) == 3


def test_a_bias_and_its_drift_do_not_matter() -> None:
    time = readings(1000.0, 40.0)
    force = pulses(time, 3.0, 3.5, 36.0) - 12.0 + 0.002 * time
    assert len(taps_of_force(time, force)) == 3


def test_presses_shudders_and_faint_pulses_are_no_taps() -> None:
    time = readings(7000.0)
    pressed = np.where((time > 1.0) & (time < 2.0), 1.0, 0.0)
    shudder = pulses(time, 3.0, 3.03, 3.06)
    faint = pulses(time, 4.0, peak=0.0)
    tap = pulses(time, 5.0)
    assert len(taps_of_force(time, pressed + shudder + tap)) == 1
    assert len(taps_of_force(time, faint + tap)) == 1
    assert len(taps_of_force(time, np.zeros(time.size))) == 0


def test_a_tap_that_bounces_is_one_tap() -> None:
    time = readings(7000.0)
    assert len(taps_of_force(time, pulses(time, 2.0, 2.008, length=0.004))) == 1


@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_dips_are_located_well_within_a_sampling_interval(rate: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(8):
        at = np.array([1.0, 1.4, 2.1]) + rng.uniform(0.0, 0.02, 3)
        time = readings(rate, 4.0)
        height = np.minimum(0.2 * np.abs(time[:, None] - at).min(axis=1), 3e-3)
        taps = taps_of_height(time, height + 2e-5 * rng.standard_normal(time.size))
        assert len(taps) == 3
        assert np.abs(taps.middle - at).max() < 0.3 / rate


def test_going_down_to_stay_is_no_dip() -> None:
    time = readings(250.0)
    height = np.interp(time, [1.0, 1.02, 3.0, 3.02], [0.01, 0.0, 0.0, 0.01])
    assert len(taps_of_height(time, height)) == 0
    assert dip(time, height).max() < 1e-9
    assert np.isnan(middle_of_dip(time, dip(time, height), 2.0))


def test_taps_belong_together_where_they_are_near() -> None:
    times = np.array([1.0, 1.4, 2.0, 9.0, 50.0, 50.3])
    groups = groups_of(Taps(begin=times, end=times + 0.006, spacing=1e-3))
    assert [group.begin.tolist() for group in groups] == [[1.0, 1.4, 2.0], [50.0, 50.3]]
    assert groups_of(Taps(begin=times[:0], end=times[:0], spacing=1e-3)) == ()


def test_few_readings_hold_no_taps_and_what_is_not_in_order_is_refused() -> None:
    for count in (0, 1, 5):
        time = np.arange(float(count))
        assert len(taps_of_force(time, time)) == len(taps_of_height(time, time)) == 0
    with pytest.raises(InputError):
        taps_of_force(np.array([0.0, 1.0, 1.0]), np.zeros(3))
    with pytest.raises(InputError):
        taps_of_height(np.zeros(3), np.zeros(2))
