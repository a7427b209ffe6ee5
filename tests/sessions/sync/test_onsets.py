"""Onsets: what goes on is predicted away, what comes new is found to the sample."""

import numpy as np
import pytest

from monochord.core.types import Floats
from monochord.sessions.sync.onsets import first_onset, novelty, pick, surprise

RATE = 44100


def ringing(seed: int, frames: int = 22050) -> Floats:
    """Two channels of ten decaying partials, with a converter's noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / RATE
    partials = rng.uniform(200.0, 9000.0, (2, 10, 1))
    sound = (0.05 * np.sin(2.0 * np.pi * partials * time + rng.uniform(0.0, 6.3, partials.shape))).sum(axis=1)
    return sound + 3e-5 * rng.standard_normal(sound.shape)


@pytest.mark.parametrize("seed", range(5))
def test_a_step_under_a_ringing_string_is_located_to_the_sample(seed: int) -> None:
    sound = ringing(seed)
    assert np.abs(sound).max() > 0.2
    sound[:, 12000:] += 0.03
    errors = surprise(sound)
    for channel in errors:
        assert abs(first_onset(channel[11700:12100]) - 300) <= 1
    assert abs(int(novelty(errors, 44).argmax()) * 44 - 12000) <= 44


def test_a_quiet_channel_counts_as_much_as_a_loud_one() -> None:
    sound = ringing(0)
    assert np.allclose(surprise(sound), surprise(sound * np.array([[1.0], [1e-3]])), rtol=1e-6)


def test_silence_surprises_nobody() -> None:
    errors = surprise(np.zeros((2, 4410), np.float32))
    assert not errors.any()
    assert not novelty(errors, 44).any()
    assert np.isnan(first_onset(errors[0]))
    assert np.isnan(pick(errors[0, :8]))


def test_the_first_of_two_events_is_located_but_no_faint_one() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        errors = rng.standard_normal(700)
        errors[300:] *= 20.0
        errors[500:] *= 5.0
        assert abs(first_onset(errors) - 300) <= 3
        errors[300:500] /= 10.0
        assert abs(first_onset(errors) - 500) <= 6


@pytest.mark.parametrize("quiet", [8, 16, 32])
def test_a_stretch_that_begins_quiet_by_chance_does_not_move_the_onset(quiet: int) -> None:
    rng = np.random.default_rng(quiet)
    for _ in range(20):
        errors = rng.standard_normal(600)
        errors[:quiet] *= 0.2
        errors[500:] *= 10.0
        assert abs(first_onset(errors) - 500) <= 6
