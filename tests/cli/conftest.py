"""Take of a stiff string, pressed and plucked, as recordings on disk."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile

Take = Callable[..., Path]
LENGTH, OPEN = 0.65, 110.0


@pytest.fixture
def take(tmp_path: Path) -> Take:
    """Return what writes a take: a 0.65 m string of 110 Hz, pressed at a position, its far side plucked.

    `sharp` is how much pressing raises the frequency.
    """

    def write(
        position: float, *, seconds: float = 0.6, rate: int = 44100, channels: int = 1, sharp: float = 1.0
    ) -> Path:
        far = LENGTH - position
        frequency, stiffness = sharp * OPEN * LENGTH / far, 8e-5 * (LENGTH / far) ** 2
        t = np.arange(round(seconds * rate)) / rate
        sound = 1e-5 * np.random.default_rng(0).standard_normal(t.size)
        for n in range(1, 15):
            partial = n * frequency * np.sqrt(1.0 + stiffness * n * n)
            sound += 0.2 / n * np.exp(-(0.5 + 0.3 * n) * t) * np.sin(2.0 * np.pi * partial * t + n)
        path = tmp_path / f"at_{1e3 * position:.0f}_{rate}_{channels}_{sharp}.wav"
        soundfile.write(path, np.stack([sound] * channels, axis=1), rate, subtype="FLOAT")
        return path

    return write
