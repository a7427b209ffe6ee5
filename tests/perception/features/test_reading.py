"""Sound between the lines: its density and likeness on noise that is known, whatever the lines."""

from collections.abc import Callable

import numpy as np
import pytest
from tests.perception.features.conftest import Row, Sing

from monochord.core.types import Floats, Signal
from monochord.perception.features import FEATURES
from monochord.physics.strings import load_string

Bands = Callable[..., Floats]
RATE, SIZE, BANDS = 44100, 4410, 28
EDGES = np.geomspace(20.0, 16000.0, BANDS + 1)
WIDE = EDGES[:-1] > 500.0
SIGMA = 1e-3
DENSITY = np.log10(2.0 * SIGMA**2 / RATE)
"""Of white noise of that deviation, one-sided."""


def noise(seed: int, size: int = SIZE, channels: int = 2) -> Floats:
    return SIGMA * np.random.default_rng(seed).standard_normal((channels, size))


@pytest.fixture
def bands(row: Row) -> Bands:
    """Return the function from a window (2, size) to the measures (3, bands)."""

    def measured(window: Floats) -> Floats:
        columns = row("reading", window.astype(np.float32))
        names = ("mic 1", "mic 2", "likeness")
        return np.array(
            [[columns[f"gaps {what} band {band + 1}"] for band in range(BANDS)] for what in names]
        )

    return measured


@pytest.mark.parametrize("size", [882, 4410])
def test_density_is_that_of_the_noise_in_windows_of_any_length(bands: Bands, size: int) -> None:
    each = np.array([bands(noise(seed, size) * np.array([[1.0], [0.1]]))[:2] for seed in range(20)])
    mean = each.mean(axis=0)
    assert mean[0, WIDE] == pytest.approx(np.full(WIDE.sum(), DENSITY), abs=0.15)
    assert mean[1, WIDE] == pytest.approx(np.full(WIDE.sum(), DENSITY - 2.0), abs=0.15)
    assert mean[0, WIDE].mean() == pytest.approx(DENSITY, abs=0.04)
    # In few bins a median of noise is uncertain, and no more than that.
    assert np.abs(mean[0] - DENSITY).max() < 0.4


@pytest.mark.parametrize("position", [None, 0.083])
def test_lines_do_not_move_it(bands: Bands, sing: Sing, position: float | None) -> None:
    hiss = noise(1)
    # Louder lines than these, 55 dB over a bin's noise, leak through the taper's sidelobes.
    alone, together = bands(hiss), bands(0.1 * sing(position, (1, 2), partials=4) + hiss)
    assert together[:2, WIDE] == pytest.approx(alone[:2, WIDE], abs=0.25)
    line = 0.01 * np.sin(2.0 * np.pi * 5003.0 * np.arange(SIZE) / RATE)
    beside = bands(line + hiss)
    assert beside[:, WIDE] == pytest.approx(alone[:, WIDE], abs=0.06)


def test_each_band_measures_its_own_frequencies(bands: Bands) -> None:
    spectrum = np.fft.rfft(noise(2))
    frequency = np.fft.rfftfreq(SIZE, 1.0 / RATE)
    for band in (14, 20, 27):
        inside = (frequency >= EDGES[band]) & (frequency < EDGES[band + 1])
        measured = bands(np.fft.irfft(spectrum * inside, SIZE))
        assert measured[0, band] > DENSITY - 0.3
        assert (np.delete(measured[0], [band - 1, band, band + 1][: BANDS + 1 - band]) < DENSITY - 2.0).all()


def test_likeness_of_noise_at_both_microphones(bands: Bands) -> None:
    one = noise(3, channels=1)
    for gain in (1.0, -1.0, 0.5):
        expected = 2.0 * gain / (1.0 + gain**2)
        assert bands(np.concatenate((one, gain * one)))[2] == pytest.approx(
            np.full(BANDS, expected), abs=1e-3
        )
    independent = np.mean([bands(noise(seed))[2] for seed in range(4, 34)], axis=0)
    assert np.abs(independent).max() < 0.4
    assert np.abs(independent[WIDE]).max() < 0.1


def test_likeness_is_that_between_the_lines(bands: Bands, sing: Sing) -> None:
    one = noise(5, channels=1)
    opposite = bands(0.1 * sing(0.083, (1, 2), partials=4) + np.concatenate((one, -one)))
    assert (opposite[2, WIDE] < -0.8).all()


def test_silence_is_the_least_density_and_a_dead_microphone_like_nothing(bands: Bands) -> None:
    silent = bands(np.zeros((2, SIZE)))
    assert (silent[:2] == np.float32(-15.0)).all()
    assert not silent[2].any()
    assert not bands(noise(7) * np.array([[1.0], [0.0]]))[2].any()


def test_a_sensor_sampled_slowly_has_no_sound_above_half_the_rate() -> None:
    signal = Signal(sample_rate=11025, channels=2, string=load_string("prototype").string)
    extract = FEATURES.build("reading").prepare(signal, 1102)
    row = dict(zip(extract.columns, extract(noise(10, 1102)[np.newaxis].astype(np.float32))[0], strict=True))
    assert row["gaps mic 1 band 28"] == np.float32(-15.0)
    assert row["gaps mic 1 band 20"] > -15.0 + 3.0
