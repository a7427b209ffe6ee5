"""The harmonics of both segments: what each column says of sound whose harmonics are known."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.errors import InputError
from monochord.features import FEATURES
from monochord.types import Audio, Signal

Sing = Callable[..., Audio]
RATE, SIZE, LENGTH = 44100, 4410, 0.2


def told(signal: Signal, window: Audio) -> dict[str, float]:
    extract = FEATURES.build("fft_harmonic").prepare(signal, window.shape[1])
    return dict(zip(extract.columns, extract(window[np.newaxis])[0].tolist(), strict=True))


def test_it_has_four_groups_of_seventy_five(signal: Signal) -> None:
    columns = FEATURES.build("fft_harmonic").prepare(signal, SIZE).columns
    groups = [column.rsplit(" ", 9)[0].split(" ")[0] for column in columns]
    assert [groups.count(group) for group in ("mic", "difference", "ratio")] == [150, 75, 75]
    assert sum(column.startswith("mic 1 ") for column in columns) == 75


@pytest.mark.parametrize("position", [0.055, 0.083, 0.1013, 0.127, 0.148])
@pytest.mark.parametrize("modes", [(1, 1), (1, 2), (1, 3), (1, 4), (2, 1)])
def test_place_is_told_whichever_modes_the_drivers_hold(
    signal: Signal, sing: Sing, position: float, modes: tuple[int, int]
) -> None:
    row = told(signal, sing(position, modes))
    assert row["ratio place"] == pytest.approx(position / LENGTH, abs=2e-4)
    assert (row["ratio mode 1"], row["ratio mode 2"]) == modes
    assert row["ratio open"] == pytest.approx(0.0, abs=0.05)
    nearest = max(range(1, 25), key=lambda point: row[f"ratio near {point}"])
    assert (nearest - 1) / 23 == pytest.approx(position / LENGTH, abs=0.5 / 23 + 1e-9)
    assert sum(row[f"ratio near {point}"] for point in range(1, 25)) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("size", [882, 2205, 22050])
def test_place_is_told_by_short_and_long_windows(signal: Signal, sing: Sing, size: int) -> None:
    row = told(signal, sing(0.083, (1, 2), size=size))
    assert row["ratio place"] == pytest.approx(0.083 / LENGTH, abs=1e-3)


def test_tension_moves_the_open_frequency_and_not_the_place(signal: Signal, sing: Sing) -> None:
    slack, tight = (told(signal, sing(0.083, (1, 2), tension=65.0 * by)) for by in (0.995, 1.005))
    assert tight["ratio open"] - slack["ratio open"] == pytest.approx(5.0, abs=0.1)
    assert tight["ratio place"] == pytest.approx(slack["ratio place"], abs=1e-4)


def test_level_is_the_power_of_a_harmonic(signal: Signal, sing: Sing) -> None:
    row = told(signal, sing(0.083, (1, 1), partials=2, crosstalk=0.1))
    assert row["mic 1 own 1 level"] == pytest.approx(np.log10(0.2**2 / 2.0), abs=0.01)
    assert row["mic 1 own 2 level"] == pytest.approx(np.log10(0.1**2 / 2.0), abs=0.01)
    assert row["difference segment 1 1 level"] == pytest.approx(2.0, abs=0.05)
    assert row["difference segment 2 1 level"] == pytest.approx(-2.0, abs=0.05)
    assert row["ratio segment 1 2 timbre"] == pytest.approx(2.0 * np.log10(0.5), abs=0.02)
    assert row["ratio segment 1 1 likeness"] == pytest.approx(0.2 / 1.01, abs=0.01)
    assert row["mic 1 own 5 level"] < -6.0


def test_growth_is_that_of_the_amplitude(signal: Signal, sing: Sing) -> None:
    row = told(signal, sing(0.083, (1, 2), decay=7.0))
    assert row["mic 1 own 1 growth"] == pytest.approx(-7.0, abs=0.1)
    assert row["mic 2 own 2 growth"] == pytest.approx(-7.0, abs=0.1)
    assert row["mic 1 rise"] == pytest.approx(-0.7 * np.log10(np.e), abs=0.02)


def test_a_line_off_its_place_has_an_offset(signal: Signal, sing: Sing) -> None:
    window = sing(0.083, (1, 1))
    row = told(signal, window)
    extra = 2.0 * 1010.565 * LENGTH / 0.083 * 1.004
    beside = (0.02 * np.sin(2.0 * np.pi * extra * np.arange(SIZE) / RATE)).astype(np.float32)
    moved = told(signal, window + beside)
    assert abs(row["mic 1 own 1 offset"]) < 0.01
    assert moved["mic 1 own 2 offset"] == pytest.approx(4.0, abs=2.5)
    assert moved["mic 1 own 2 level"] == pytest.approx(np.log10(0.02**2 / 2.0), abs=0.01)


def test_sidebands_are_told(signal: Signal, sing: Sing) -> None:
    window = sing(0.083, (1, 2))
    wavering = window * (1.0 + 0.2 * np.sin(2.0 * np.pi * 50.0 * np.arange(SIZE) / RATE)).astype(np.float32)
    still, moving = told(signal, window), told(signal, wavering)
    assert still["mic 1 own 1 side"] < -3.0
    assert moving["mic 1 own 1 side"] == pytest.approx(2.0 * np.log10(0.1) + np.log10(2.0), abs=0.1)
    assert moving["mic 1 unrest"] > still["mic 1 unrest"] + 0.005


def test_rumble_and_filled_gaps_are_told(signal: Signal, sing: Sing) -> None:
    window, time = sing(0.083, (1, 2), partials=4), np.arange(SIZE) / RATE
    hiss = 1e-3 * np.random.default_rng(5).standard_normal((2, SIZE))
    low = 1e-2 * np.sin(2.0 * np.pi * 300.0 * time)
    plain, rough = told(signal, window), told(signal, (window + hiss + low).astype(np.float32))
    assert rough["mic 1 rumble 150 Hz"] == pytest.approx(np.log10(1e-4 / 2.0), abs=0.05)
    assert plain["mic 1 rumble 150 Hz"] < -6.0
    for gap in ("2 kHz", "6 kHz", "12 kHz"):
        assert rough[f"mic 2 gaps {gap}"] > plain[f"mic 2 gaps {gap}"] + 2.0
    assert rough["mic 1 flatness"] > plain["mic 1 flatness"] + 0.5


def test_an_untouched_string_is_told_from_a_touched_one(signal: Signal, sing: Sing) -> None:
    for modes in ((1, 1), (1, 2), (3, 1), (2, 3)):
        row = told(signal, sing(None, modes, partials=2))
        assert row["ratio contact"] < 0.0
        assert row["ratio rest"] == pytest.approx(0.0, abs=1.0)
    assert told(signal, sing(0.083, (1, 2)))["ratio contact"] > 0.5


def test_what_it_cannot_serve_is_refused(signal: Signal) -> None:
    feature = FEATURES.build("fft_harmonic")
    with pytest.raises(InputError, match=r"1 channel.*allowed is two channels of a known string"):
        feature.prepare(Signal(sample_rate=RATE, channels=1, string=signal.string), SIZE)
    with pytest.raises(InputError, match=r"an unknown string.*--string"):
        feature.prepare(Signal(sample_rate=RATE, channels=2), SIZE)
    with pytest.raises(InputError, match="sample rate 8000 Hz: allowed is from 8085 Hz"):
        feature.prepare(Signal(sample_rate=8000, channels=2, string=signal.string), SIZE)
    with pytest.raises(InputError, match="window of 441 frames: allowed is from 611 frames"):
        feature.prepare(signal, 441)
