"""The baseline is a fair one."""

import numpy as np
import pytest

from monochord.core.types import Window
from monochord.evaluation.realstrings import period


@pytest.mark.parametrize("frequency", [82.4, 196.0, 440.0, 1000.0])
def test_period_of_a_harmonic_tone(frequency: float) -> None:
    time = np.arange(4410) / 44100
    tone = sum(np.sin(2 * np.pi * n * frequency * time) / n for n in range(1, 8))
    window = Window(samples=np.atleast_2d(tone).astype(np.float32), start=0, sample_rate=44100)
    assert 44100 / period(window, 44100 / 1600, 44100 / 80) == pytest.approx(frequency, rel=2e-3)
