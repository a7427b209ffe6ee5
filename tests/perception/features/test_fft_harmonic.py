"""The harmonics of both segments: each column on sound whose harmonics are known."""

import numpy as np
import pytest
from tests.perception.features.conftest import Row, Sing

from monochord.core.errors import InputError
from monochord.core.types import Signal
from monochord.perception.features import FEATURES
from monochord.physics.strings import load_string

RATE, SIZE, LENGTH = 44100, 4410, 0.2
STRING = load_string("prototype").string
TIME = np.arange(SIZE) / RATE


MIRRORED = pytest.mark.xfail(
    reason="tones without any noise of a string are read elsewhere: docs/ROADMAP.md", raises=AssertionError
)
PLACES = [(0.055, (1, 1)), (0.083, (1, 2)), (0.1013, (1, 3)), (0.127, (1, 4)), (0.148, (2, 1))]


@pytest.mark.parametrize(
    ("position", "modes", "partials"),
    [
        *(pytest.param(*each, 3, marks=MIRRORED if each[1] == (1, 4) else ()) for each in PLACES),
        *(pytest.param(*each, 1, marks=MIRRORED if each[1] == (1, 3) else ()) for each in PLACES),
    ],
)
def test_place_whichever_modes_the_drivers_sustain(
    row: Row, sing: Sing, position: float, modes: tuple[int, int], partials: int
) -> None:
    columns = row("fft_harmonic", sing(position, modes, partials=partials))
    assert columns["ratio place"] == pytest.approx(position / LENGTH, abs=2e-4)
    assert (columns["ratio mode 1"], columns["ratio mode 2"]) == modes
    assert columns["ratio open"] == pytest.approx(0.0, abs=0.05)
    near = np.array([columns[f"ratio near {point}"] for point in range(1, 25)])
    assert near.sum() == pytest.approx(1.0, abs=1e-5)
    assert near @ np.linspace(0.0, 1.0, 24) == pytest.approx(position / LENGTH, abs=2e-4)


@pytest.mark.parametrize(("size", "error"), [(882, 2e-2), (22050, 1e-3)])
def test_place_in_short_and_long_windows(row: Row, sing: Sing, size: int, error: float) -> None:
    columns = row("fft_harmonic", sing(0.083, (1, 2), size=size))
    assert columns["ratio place"] == pytest.approx(0.083 / LENGTH, abs=error)


def test_tension_moves_the_open_frequency_and_not_the_place(row: Row, sing: Sing) -> None:
    slack, tight = (row("fft_harmonic", sing(0.083, (1, 2), tension=65.0 * by)) for by in (0.995, 1.005))
    assert tight["ratio open"] - slack["ratio open"] == pytest.approx(5.0, abs=0.1)
    assert tight["ratio place"] == pytest.approx(slack["ratio place"], abs=1e-4)


def test_level_is_the_power_of_a_harmonic(row: Row, sing: Sing) -> None:
    columns = row("fft_harmonic", sing(0.083, (1, 1), partials=2, crosstalk=0.1))
    assert columns["mic 1 own 1 level"] == pytest.approx(np.log10(0.2**2 / 2.0), abs=0.01)
    assert columns["mic 1 own 2 level"] == pytest.approx(np.log10(0.1**2 / 2.0), abs=0.01)
    assert columns["difference segment 1 1 level"] == pytest.approx(2.0, abs=0.05)
    assert columns["difference segment 2 1 level"] == pytest.approx(-2.0, abs=0.05)
    assert columns["ratio segment 1 2 timbre"] == pytest.approx(2.0 * np.log10(0.5), abs=0.02)
    assert columns["ratio segment 1 1 likeness"] == pytest.approx(0.2 / 1.01, abs=0.01)
    assert columns["mic 1 own 5 level"] < -6.0


def test_growth_is_that_of_the_amplitude(row: Row, sing: Sing) -> None:
    columns = row("fft_harmonic", sing(0.083, (1, 2), decay=7.0))
    assert columns["mic 1 own 1 growth"] == pytest.approx(-7.0, abs=0.1)
    assert columns["mic 2 own 2 growth"] == pytest.approx(-7.0, abs=0.1)
    assert columns["mic 1 rise"] == pytest.approx(-0.7 * np.log10(np.e), abs=0.02)


def test_a_line_off_its_partial_has_an_offset(row: Row, sing: Sing) -> None:
    window = sing(0.083, (1, 1))
    beside = 0.02 * np.sin(2.0 * np.pi * 2.0 * 1010.565 * LENGTH / 0.083 * 1.004 * TIME)
    columns, moved = (row("fft_harmonic", (window + extra).astype(np.float32)) for extra in (0.0, beside))
    assert abs(columns["mic 1 own 1 offset"]) < 0.01
    assert moved["mic 1 own 2 offset"] == pytest.approx(4.0, abs=2.5)
    assert moved["mic 1 own 2 level"] == pytest.approx(np.log10(0.02**2 / 2.0), abs=0.01)


def test_sidebands_of_a_wavering_tone(row: Row, sing: Sing) -> None:
    window = sing(0.083, (1, 2))
    wavering = window * (1.0 + 0.2 * np.sin(2.0 * np.pi * 50.0 * TIME)).astype(np.float32)
    still, moving = row("fft_harmonic", window), row("fft_harmonic", wavering)
    assert still["mic 1 own 1 side"] < -3.0
    assert moving["mic 1 own 1 side"] == pytest.approx(2.0 * np.log10(0.1) + np.log10(2.0), abs=0.1)
    assert moving["mic 1 unrest"] > still["mic 1 unrest"] + 0.005


def test_rumble_and_noise_between_the_lines(row: Row, sing: Sing) -> None:
    window = sing(0.083, (1, 2), partials=4)
    noise = 1e-3 * np.random.default_rng(5).standard_normal((2, SIZE))
    low = 1e-2 * np.sin(2.0 * np.pi * 300.0 * TIME)
    plain, rough = row("fft_harmonic", window), row("fft_harmonic", (window + noise + low).astype(np.float32))
    assert rough["mic 1 rumble 150 Hz"] == pytest.approx(np.log10(1e-4 / 2.0), abs=0.05)
    assert plain["mic 1 rumble 150 Hz"] < -6.0
    for gap in ("2 kHz", "6 kHz", "12 kHz"):
        assert rough[f"mic 2 gaps {gap}"] > plain[f"mic 2 gaps {gap}"] + 2.0
    assert rough["mic 1 flatness"] > plain["mic 1 flatness"] + 0.5


def test_an_untouched_string_is_told_from_a_touched_one(row: Row, sing: Sing) -> None:
    for modes in ((1, 1), (1, 2), (3, 1), (2, 3)):
        columns = row("fft_harmonic", sing(None, modes, partials=2))
        assert columns["ratio untouched"] > np.log(0.5)
        assert columns["ratio rest"] == pytest.approx(0.0, abs=1.0)
    assert row("fft_harmonic", sing(0.083, (1, 2)))["ratio untouched"] < np.log(0.1)


@pytest.mark.parametrize("feature", ["fft_harmonic", "reading"])
def test_unsuitable_signals_are_refused(feature: str) -> None:
    for signal, size in (
        (Signal(sample_rate=RATE, channels=1, string=STRING), SIZE),
        (Signal(sample_rate=RATE, channels=2), SIZE),
        (Signal(sample_rate=8000, channels=2, string=STRING), SIZE),
        (Signal(sample_rate=RATE, channels=2, string=STRING), 441),
    ):
        with pytest.raises(InputError):
            FEATURES.build(feature).prepare(signal, size)
