"""Noises have the spectrum and the level that they promise."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.dsp.noise import NOISES, Shape, band, hum, mixed, noise_loop, pink, white

RATE = 44100.0


@pytest.mark.parametrize("name", NOISES)
def test_every_noise_has_unit_level_in_each_channel_and_is_determined_by_its_seed(name: str) -> None:
    first, again = (NOISES[name](np.random.default_rng(3), (2, 4410), RATE) for _ in range(2))
    other = NOISES[name](np.random.default_rng(4), (2, 4410), RATE)
    assert np.sqrt((first**2).mean(axis=1)) == pytest.approx([1.0, 1.0])
    assert (first == again).all()
    assert not (first == other).any()


def density(noise: np.ndarray, low: float, high: float) -> float:
    """Mean power a bin between two frequencies."""
    frequencies = np.fft.rfftfreq(noise.shape[-1], 1.0 / RATE)
    power = np.abs(np.fft.rfft(noise)) ** 2
    return float(power[..., (frequencies >= low) & (frequencies < high)].mean())


def test_white_is_as_strong_everywhere_and_independent_in_the_channels() -> None:
    noise = white(np.random.default_rng(0), (2, 1 << 17), RATE)
    assert density(noise, 100, 1000) == pytest.approx(density(noise, 10000, 20000), rel=0.1)
    assert abs(float((noise[0] * noise[1]).mean())) < 0.02


def test_pink_falls_with_the_frequency() -> None:
    noise = pink(np.random.default_rng(0), (2, 1 << 17), RATE)
    assert density(noise, 100, 200) == pytest.approx(10 * density(noise, 1000, 2000), rel=0.15)
    assert density(noise, 0, 29) < 1e-12 * density(noise, 100, 200)


def test_band_is_silent_outside() -> None:
    noise = band(np.random.default_rng(0), (1 << 17,), RATE)
    assert density(noise, 2010, 4000) == pytest.approx(density(noise, 4000, 7990), rel=0.1)
    assert max(density(noise, 0, 1990), density(noise, 8010, 22050)) < 1e-12 * density(noise, 3000, 4000)


def test_hum_has_harmonics_of_the_mains_and_nothing_else() -> None:
    spectrum = np.abs(np.fft.rfft(hum(np.random.default_rng(0), (44100,), RATE, mains=50.0, harmonics=4)))
    lines = np.flatnonzero(spectrum > 1e-6 * spectrum.max())
    assert lines.tolist() == [50, 100, 150, 200]
    assert spectrum[lines] * [1, 2, 3, 4] == pytest.approx(spectrum[50])
    assert np.abs(np.fft.rfft(hum(np.random.default_rng(0), (1000,), 1000.0))).argmax() == 60


def test_a_loop_goes_on_without_a_jump_within_it_and_where_it_is_repeated() -> None:
    def low(stream: np.random.Generator, shape: Shape, rate: float) -> np.ndarray:
        return band(stream, shape, rate, low=100.0, high=500.0)

    loop = noise_loop(low, np.random.default_rng(0), (2, 4410), RATE, stretches=5)
    steps = np.abs(np.diff(np.concatenate([loop, loop[:, :1]], axis=1)))
    assert steps.max() < 2.5 * 2 * np.pi * 500.0 / RATE  # of a sine of 500 Hz and 2.5 times the level
    assert np.abs(np.diff(low(np.random.default_rng(0), (5, 4410), RATE)[:, [0, -1]].ravel())).max() > 1.0


def test_a_loop_is_as_loud_where_its_stretches_meet() -> None:
    loop = noise_loop(white, np.random.default_rng(0), (1, 44100), RATE, stretches=3, fade=0.5)
    meeting, alone = (loop.reshape(3, 2, -1)[:, k] for k in (0, 1))
    assert meeting.std() == pytest.approx(1.0, abs=0.02)
    assert alone.std() == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("ratio", [-5.0, 25.0])
def test_mixing_keeps_the_ratio_over_all_channels_and_their_balance(ratio: float) -> None:
    rng = np.random.default_rng(0)
    signal = rng.normal(size=(2, 4410)) * [[1.0], [0.1]]
    added = mixed(signal, white(rng, signal.shape, RATE), ratio) - signal
    assert 10.0 * np.log10((signal**2).mean() / (added**2).mean()) == pytest.approx(ratio)
    assert added[0].std() == pytest.approx(added[1].std(), rel=0.05)


def test_silence_stays_silence() -> None:
    assert not mixed(np.zeros((2, 100)), np.ones((2, 100)), 10.0).any()


@pytest.mark.parametrize(
    "wrong",
    [
        lambda stream: hum(stream, (100,), 100.0),
        lambda stream: pink(stream, (1,), RATE),
        lambda stream: band(stream, (4,), RATE),
        lambda _: mixed(np.ones((2, 100)), np.zeros((2, 100)), 10.0),
    ],
    ids=["mains too high", "too short for pink", "too short for a band", "silent noise"],
)
def test_noise_that_cannot_be_is_refused(wrong: Callable[[np.random.Generator], object]) -> None:
    with pytest.raises(InputError):
        wrong(np.random.default_rng(0))
