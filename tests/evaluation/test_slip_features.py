"""The two features hear what they are for and nothing else."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.evaluation.sliding import filled_gaps, rumble

RATE = 44100.0
TIME = np.arange(4410) / RATE


def tone(frequency: float, amplitude: float = 1.0) -> Floats:
    return amplitude * np.sin(2.0 * np.pi * frequency * TIME)


def ring(open_frequency: float) -> Floats:
    return np.array(
        [sum(tone(n * open_frequency, 0.5 / n) for n in range(1, 15)), tone(1.7 * open_frequency)]
    )


def test_rumble_is_the_level_of_what_is_slow() -> None:
    slow = np.array([tone(150.0, 0.01), tone(90.0, 0.02)])
    expected = 10.0 * np.log10(0.5 * (0.01**2 + 0.02**2))
    assert rumble(slow, RATE, 1010.0) == pytest.approx(expected, abs=0.1)
    # A ring of full scale, whose Hann skirts fall far below, changes it by less than 0.2 dB.
    assert rumble(slow + ring(1010.0), RATE, 1010.0) == pytest.approx(expected, abs=0.2)


def test_rumble_is_deaf_to_a_ringing_string() -> None:
    assert rumble(ring(1010.0), RATE, 1010.0) < -60.0


def test_gaps_of_noise_are_full_and_of_a_string_empty() -> None:
    stream = np.random.default_rng(3)
    noise = stream.normal(0.0, 0.1, (1, 4410))
    # The geometric mean of an exponential variable is exp(-0.577) of its mean: -2.51 dB; 550 bins are free.
    assert filled_gaps(noise, RATE) == pytest.approx(-2.51, abs=0.5)
    empty = filled_gaps(ring(1010.0), RATE)
    filled = [filled_gaps(ring(1010.0) + level * noise, RATE) for level in (1e-5, 1e-3, 1e-1)]
    assert empty < filled[0] < filled[1] < filled[2] < -2.0


def test_gaps_do_not_depend_on_loudness() -> None:
    sound = ring(1010.0) + np.random.default_rng(4).normal(0.0, 1e-3, (2, 4410))
    assert filled_gaps(0.1 * sound, RATE) == pytest.approx(filled_gaps(sound, RATE), abs=1e-6)


def test_a_window_that_tells_nothing_is_refused() -> None:
    with pytest.raises(InputError, match=r"a window of 0.000997"):
        rumble(np.zeros((2, 44)), RATE, 1010.0)
    with pytest.raises(InputError, match="sample rate 6000 Hz"):
        filled_gaps(np.zeros((2, 600)), 6000.0)
