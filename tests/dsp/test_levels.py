"""Levels: noise has no tone, a string has one, and hum is none."""

import numpy as np
import pytest

from monochord.core.types import Audio
from monochord.dsp.levels import measure_levels, tone_prominence


def noise(seconds: float, rate: int, seed: int = 0) -> Audio:
    return np.random.default_rng(seed).standard_normal((2, round(seconds * rate))).astype(np.float32)


@pytest.mark.parametrize(("rate", "seconds"), [(16000, 0.3), (44100, 0.1), (96000, 0.05)])
def test_noise_has_no_tone_and_a_line_has_as_much_as_theory_says(rate: int, seconds: float) -> None:
    time = np.arange(round(seconds * rate)) / rate
    found = [tone_prominence(noise(seconds, rate, seed), rate) for seed in range(50)]
    assert max(found) < 60.0
    assert np.mean(found) < 25.0
    # A Hann window keeps 1/4 of a sine's squared sum and 3/8 of the noise's; its median is ln 2 of its mean.
    amplitude = 0.5
    expected = (amplitude * time.size / 4.0) ** 2 / (0.375 * time.size) / np.log(2.0)
    frequency = round(1500.0 * seconds) / seconds
    tone = (amplitude * np.sin(2.0 * np.pi * frequency * time)).astype(np.float32)
    found = [tone_prominence(noise(seconds, rate, seed) + tone, rate) for seed in range(50)]
    assert np.median(found) == pytest.approx(expected, rel=0.3)


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_hum_is_no_tone(mains: float) -> None:
    time = np.arange(4410) / 44100
    hum = np.sin(2.0 * np.pi * mains * np.outer(np.arange(1, 17), time)).sum(axis=0)
    assert tone_prominence(noise(0.1, 44100) + hum, 44100) < 40.0
    assert tone_prominence(noise(0.1, 44100) + np.sin(2.0 * np.pi * 1200.0 * time), 44100) > 400.0


def test_one_channel_is_enough() -> None:
    time = np.arange(4410) / 44100
    sound = noise(0.1, 44100)
    sound[1] = np.sin(2.0 * np.pi * 1200.0 * time)
    assert tone_prominence(sound, 44100) > 400.0
    sound[0] = 0.0
    assert tone_prominence(sound, 44100) > 400.0
    assert tone_prominence(0.0 * sound, 44100) == 0.0


@pytest.mark.parametrize(("seconds", "rate"), [(0.01, 44100), (0.1, 800)])
def test_a_window_that_is_too_short_has_any_tone(seconds: float, rate: int) -> None:
    assert tone_prominence(noise(seconds, rate), rate) == np.inf


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_cut_off_at_one_side_is_loud(sign: float) -> None:
    samples = (0.1 * noise(0.1, 44100)).clip(-0.5, 0.5)
    samples[0, ::100] = sign
    loud = measure_levels(samples, 44100)[:, 1]
    assert loud.tolist() == pytest.approx([0.01, 0.0], abs=5e-4)
