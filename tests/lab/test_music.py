import numpy as np
import pytest

from monochord.lab.music import LOUDNESS, loop


def test_a_seed_is_a_tune() -> None:
    first, second = loop(1), loop(2)
    np.testing.assert_array_equal(first, loop(1))
    assert first.size == second.size
    assert np.corrcoef(first, second)[0, 1] < 0.9


def test_it_is_as_loud_as_told_and_has_bass_middle_and_treble() -> None:
    sound = loop(0).astype(float)
    assert np.sqrt(np.mean(sound**2)) == pytest.approx(LOUDNESS)
    power = np.abs(np.fft.rfft(sound)) ** 2
    frequency = np.fft.rfftfreq(sound.size, 1.0 / 44100.0)
    bands = [(40, 250), (250, 2000), (2000, 8000)]
    share = [power[(frequency >= low) & (frequency < high)].sum() / power.sum() for low, high in bands]
    assert share[0] > share[1] > share[2] > 1e-3


def test_it_goes_round_without_a_seam() -> None:
    sound = loop(0)
    steps = np.abs(np.diff(sound))
    assert abs(float(sound[0]) - float(sound[-1])) <= steps.max()
