"""Sliding is told from rest by two features, the better the faster it is."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from studies._sliding import (
    FEATURES,
    Sliding,
    feature_values,
    filled_gaps,
    rumble,
    separations,
    windows_of,
)

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.physics.materials import load_material
from monochord.physics.strings import load_string
from monochord.physics.twin import Ebow, Sensor

SENSOR = Sensor(
    name="gentle",
    string=load_string("prototype").string,
    drivers=(Ebow(sense=0.02, drive=0.03, limit=1e-3), Ebow(sense=0.18, drive=0.17, limit=1e-3)),
    range=(0.05, 0.15),
)
STUDY = Sliding(sensor=SENSOR, material=load_material("plastic"), runs=8, windows=3, settle=0.3)


def test_both_features_separate_fast_sliding_from_rest() -> None:
    rows = separations(STUDY, (0.002, 0.1))
    assert [(one.feature, one.speed) for one in rows] == [(f, v) for f in FEATURES for v in (0.002, 0.1)]
    areas = {(one.feature, one.speed): one.area for one in rows}
    for feature in FEATURES:
        assert areas[feature, 0.1] >= areas[feature, 0.002]
    assert areas["rumble", 0.1] > 0.95
    assert areas["filled gaps", 0.1] > 0.75
    for one in rows:
        assert 0.0 <= one.low <= one.area <= one.high <= 1.0
        assert one.slipping <= 24 >= one.resting > 12


def test_windows_depend_on_the_seed() -> None:
    once, again = windows_of(STUDY, 3, 0.02), windows_of(STUDY, 3, 0.02)
    assert len(once) > 0
    assert once[0].shape == (2, 4410)
    np.testing.assert_array_equal(np.array(once), np.array(again))
    other = windows_of(replace(STUDY, seed=1), 3, 0.02)
    assert not np.array_equal(once[0], other[0])


def test_windows_that_stick_do_not_count_as_sliding() -> None:
    # A press of 9.9 N by rubber holds the string for seconds at 2 mm/s: nothing slips.
    sticking = replace(STUDY, material=load_material("rubber"), forces=(9.9, 9.9), runs=2)
    assert windows_of(sticking, 0, 0.002) == []
    with pytest.raises(InputError, match="slipping"):
        separations(sticking, (0.002,))


def test_every_window_has_both_features() -> None:
    low, gaps = feature_values(STUDY, 0.0)
    assert len(low) == len(gaps) == STUDY.runs
    assert [values.size for values in low] == [values.size for values in gaps]
    assert np.isfinite(np.concatenate(low + gaps)).all()


def test_noise_has_the_stated_level() -> None:
    noisy, quiet = (windows_of(replace(STUDY, noise=noise), 2, 0.02) for noise in (-40.0, None))
    level = 10.0 * np.log10(np.mean((np.array(noisy) - np.array(quiet)) ** 2))
    assert level == pytest.approx(-40.0, abs=1.0)  # windows that do not count had their share in the level


@pytest.mark.slow
def test_noise_hides_slow_sliding() -> None:
    quiet, noisy = (
        {one.feature: one.area for one in separations(replace(STUDY, noise=noise), (0.005,))}
        for noise in (None, -30.0)
    )
    assert all(noisy[feature] < quiet[feature] for feature in FEATURES)


RATE = 44100.0
TIME = np.arange(4410) / RATE


def tone(frequency: float, amplitude: float = 1.0) -> Floats:
    return amplitude * np.sin(2.0 * np.pi * frequency * TIME)


def ring(open_frequency: float) -> Floats:
    partials = sum(tone(n * open_frequency, 0.5 / n) for n in range(1, 15))
    return np.array([partials, tone(1.7 * open_frequency)])


def test_rumble_is_the_level_below_the_partials_alone() -> None:
    slow = np.array([tone(150.0, 0.01), tone(90.0, 0.02)])
    expected = 10.0 * np.log10(0.5 * (0.01**2 + 0.02**2))
    assert rumble(slow, RATE, 1010.0) == pytest.approx(expected, abs=0.1)
    # A ring of full scale, whose Hann skirts fall far below, changes it by less than 0.2 dB.
    assert rumble(slow + ring(1010.0), RATE, 1010.0) == pytest.approx(expected, abs=0.2)
    assert rumble(ring(1010.0), RATE, 1010.0) < -60.0


def test_gaps_are_full_of_noise_and_empty_of_a_string_at_any_level() -> None:
    noise = np.random.default_rng(3).normal(0.0, 0.1, (1, 4410))
    # The geometric mean of an exponential variable is exp(-0.577) of its mean: -2.51 dB; 550 bins are free.
    assert filled_gaps(noise, RATE) == pytest.approx(-2.51, abs=0.5)
    levels = [filled_gaps(ring(1010.0) + level * noise, RATE) for level in (0.0, 1e-5, 1e-3, 1e-1)]
    assert levels == sorted(levels)
    assert len(set(levels)) == 4
    assert levels[-1] < -2.0
    sound = ring(1010.0) + 0.01 * noise
    assert filled_gaps(0.1 * sound, RATE) == pytest.approx(filled_gaps(sound, RATE), abs=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: replace(STUDY, runs=1),
        lambda: replace(STUDY, forces=(0.0, 1.0)),
        lambda: replace(STUDY, window=0.001),
        lambda: separations(STUDY, (0.0,)),
        lambda: rumble(np.zeros((2, 44)), RATE, 1010.0),
        lambda: filled_gaps(np.zeros((2, 600)), 6000.0),
    ],
)
def test_what_cannot_be_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
