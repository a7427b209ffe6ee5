"""Sliding is told from rest as the labels say, and better the faster it is."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.dsp.noise import pink
from monochord.evaluation.sliding import FEATURES, Sliding, feature_values, told_apart, windows_of
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


def test_faster_sliding_is_heard_better_and_both_features_hear_it() -> None:
    told = told_apart(STUDY, (0.002, 0.1))
    assert [(one.feature, one.speed) for one in told] == [(f, v) for f in FEATURES for v in (0.002, 0.1)]
    areas = {(one.feature, one.speed): one.area for one in told}
    for feature in FEATURES:
        assert areas[feature, 0.1] >= areas[feature, 0.002]
    assert areas["rumble", 0.1] > 0.95
    assert areas["filled gaps", 0.1] > 0.75
    for one in told:
        assert 0.0 <= one.low <= one.area <= one.high <= 1.0
        assert one.slipping <= 24 >= one.resting > 12


def test_windows_come_from_the_seed() -> None:
    once, again = windows_of(STUDY, 3, 0.02), windows_of(STUDY, 3, 0.02)
    assert len(once) > 0
    assert once[0].shape == (2, 4410)
    np.testing.assert_array_equal(np.array(once), np.array(again))
    other = windows_of(replace(STUDY, seed=1), 3, 0.02)
    assert not np.array_equal(once[0], other[0])


def test_what_the_label_does_not_call_slip_does_not_count() -> None:
    # A press of 9.9 N by rubber holds the string for seconds at 2 mm/s: nothing slips, whatever is asked.
    held = replace(STUDY, material=load_material("rubber"), forces=(9.9, 9.9), runs=2)
    assert windows_of(held, 0, 0.002) == []
    with pytest.raises(InputError, match=r"0 windows that slip at 0.002 m/s"):
        told_apart(held, (0.002,))


def test_both_features_have_a_value_for_every_window() -> None:
    low, gaps = feature_values(STUDY, 0.0)
    assert len(low) == len(gaps) == STUDY.runs
    assert [values.size for values in low] == [values.size for values in gaps]
    assert np.isfinite(np.concatenate(low + gaps)).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"runs": 1}, "1 runs"),
        ({"forces": (0.0, 1.0)}, "forces 0 to 1 N"),
        ({"window": 0.001}, "windows of 0.001 s"),
    ],
)
def test_a_study_that_cannot_be_is_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(STUDY, **options)  # pyright: ignore[reportArgumentType]


def test_a_speed_of_rest_is_refused() -> None:
    with pytest.raises(InputError, match="speeds 0 m/s"):
        told_apart(STUDY, (0.0,))


def test_noise_is_pink_and_as_loud_as_asked() -> None:
    sound = pink(np.random.default_rng(1), (44100,), 44100.0)
    power = np.abs(np.fft.rfft(sound)) ** 2
    octaves = [power[low : 2 * low].sum() for low in (100, 400, 1600, 6400)]
    assert max(octaves) / min(octaves) < 1.5  # 100 free bins in the lowest: a tenth or two of scatter
    noisy, quiet = (windows_of(replace(STUDY, noise=noise), 2, 0.02) for noise in (-40.0, None))
    added = np.array(noisy) - np.array(quiet)
    level = 10.0 * np.log10(np.mean(added**2))
    assert level == pytest.approx(-40.0, abs=1.0)  # windows that do not count had their share in the level


def test_noise_hides_slow_sliding() -> None:
    quiet, noisy = (
        {one.feature: one.area for one in told_apart(replace(STUDY, noise=noise), (0.005,))}
        for noise in (None, -30.0)
    )
    assert all(noisy[feature] < quiet[feature] for feature in FEATURES)
