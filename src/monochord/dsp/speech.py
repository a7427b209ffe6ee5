"""Synthetic speech as ambient noise: syllables of vowels and fricatives, without words."""

import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Hertz
from monochord.dsp.noise import band

SYLLABLE_RATE: Hertz = 4.0
"""Syllables per second of the synthetic speech."""
FORMANTS: tuple[tuple[Hertz, Hertz, Hertz], ...] = (
    (730.0, 1090.0, 2440.0),
    (270.0, 2290.0, 3010.0),
    (530.0, 1840.0, 2480.0),
    (570.0, 840.0, 2410.0),
    (300.0, 870.0, 2240.0),
)
"""First three formants of a male voice's vowels, in Hz.

Peterson and Barney (1952), Control methods used in a study of the vowels, J. Acoust. Soc. Am. 24, 175.
"""


def babble(stream: np.random.Generator, size: int, sample_rate: float) -> Floats:
    """Return synthetic speech (n,) of unit level.

    Vowels of gliding pitch and fricatives alternate in syllables and pauses, with the pitch, formants and
    rhythm of speech but without words.

    Examples
    --------
    >>> sound = babble(np.random.default_rng(0), 44100, 44100.0)
    >>> sound.shape, round(float(np.mean(sound**2)), 6)
    ((44100,), 1.0)
    """
    speech = np.zeros(size)
    length = round(sample_rate / SYLLABLE_RATE)
    time = np.arange(length) / sample_rate
    envelope = np.sin(np.pi * np.arange(length) / length) ** 2
    for start in range(0, size, length):
        if start and stream.random() < 0.2:
            continue  # a pause
        pitch = stream.uniform(90.0, 140.0) * (1.0 - 0.2 * time * SYLLABLE_RATE)
        phase = 2 * np.pi * np.cumsum(pitch) / sample_rate
        formants = np.array(FORMANTS[int(stream.integers(len(FORMANTS)))])
        number = np.arange(1, 31)
        gains = (1.0 / (1.0 + ((number[:, None] * pitch.mean() - formants) / 80.0) ** 2)).sum(axis=1)
        voice = (gains / number) @ np.sin(number[:, None] * phase)
        syllable = envelope * voice / np.sqrt(np.mean(voice**2))
        if stream.random() < 0.4:
            quarter = length // 4
            syllable[:quarter] += 0.3 * band(stream, (quarter,), sample_rate, low=3000.0, high=8000.0)
        speech[start : start + length] += syllable[: size - start]
    return speech / np.sqrt(np.mean(speech**2))
