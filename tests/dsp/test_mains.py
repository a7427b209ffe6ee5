"""Lines of mains hum: told from the partials of notes."""

import numpy as np
import pytest

from monochord.core.types import Floats
from monochord.dsp.mains import mains_lines
from monochord.dsp.pitch import PitchFinder
from monochord.dsp.spectrum import Peaks

RATE, SIZE = 44100, 4410
TIME = np.arange(SIZE) / RATE


def lines(frequency: list[float], power: list[float] | None = None) -> list[bool]:
    f = np.array(frequency)
    one = np.ones(f.size)
    peaks = Peaks(f, 0.01 * one, one if power is None else np.array(power), one, 9.0 * one)
    return mains_lines(peaks, 10.0).tolist()


def tone(frequency: float, levels: list[float], stretch: float = 0.0) -> Floats:
    """Return partials of the given levels in dB."""
    n = np.arange(1.0, len(levels) + 1.0)[:, np.newaxis]
    f = frequency * n * np.sqrt(1.0 + stretch * n * n)
    return (10.0 ** (np.array(levels)[:, np.newaxis] / 20.0) * np.sin(2.0 * np.pi * f * TIME + n)).sum(axis=0)


@pytest.mark.parametrize("base", [50.0, 60.0])
def test_multiples_of_the_mains_are_hum(base: float) -> None:
    assert all(lines([base * k * 1.0004 for k in (1, 2, 3, 5, 7)]))
    assert all(lines([base * k for k in (3, 5, 6, 7)])), "a microphone without bass"
    assert all(lines([base * k for k in (2, 4, 6)])), "a rectifier"


@pytest.mark.parametrize("note", [61.5, 98.0, 103.8, 123.5, 150.0, 240.0, 349.2, 659.26])
def test_a_note_alone_is_no_hum(note: float) -> None:
    assert not any(lines([note * n for n in range(1, 9)]))


def test_a_strong_note_at_a_multiple_is_no_hum() -> None:
    hum = lines([60.0, 180.0, 240.0, 300.0, 480.0], [0.01, 0.004, 1.0, 0.002, 0.5])
    assert hum == [True, True, False, True, False]


def test_a_peak_that_leaks_from_hum_is_hum() -> None:
    assert lines([50.0, 100.8, 150.0], [1.0, 0.003, 0.05]) == [True, True, True]


@pytest.mark.parametrize(
    ("note", "base", "level"), [(123.0, 60.0, level) for level in (-15.0, -25.0, -35.0)] + [(98.0, 50.0, 0.0)]
)
def test_hum_does_not_lower_a_note_by_an_octave(note: float, base: float, level: float) -> None:
    sound = tone(note, [-6.0 * np.log2(n) for n in range(1, 15)], 4e-5)
    sound += 10.0 ** (level / 20.0) * tone(base, [0, -25, -12, -30, -14, -30, -12])
    sound += 1e-4 * np.random.default_rng(1).standard_normal(SIZE)
    finder = PitchFinder(sample_rate=RATE, size=SIZE, lowest=60.0, highest=308.0)
    best, other = finder.find(sound[np.newaxis])[:2]
    assert best.frequency == pytest.approx(note, abs=0.1)
    assert best.evidence > other.evidence + 7.0


@pytest.mark.parametrize("base", [50.0, 60.0])
def test_hum_alone_has_no_series(base: float) -> None:
    sound = tone(base, [0, -25, -12, -30, -14, -30, -12])
    sound += 1e-3 * np.random.default_rng(1).standard_normal(SIZE)
    finder = PitchFinder(sample_rate=RATE, size=SIZE, lowest=40.0, highest=200.0)
    assert all(series.evidence < 27.0 for series in finder.find(sound[np.newaxis]))
