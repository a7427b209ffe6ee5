"""Sounds of a room that are made up: a motor, and a voice where no recording of one is at hand."""

import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds
from monochord.dsp.noise import band

TURNS: tuple[Hertz, Hertz] = (35.0, 55.0)
"""Revolutions a second that a motor's speed is drawn from."""
TEETH = 17
"""Of its gear: the mesh is heard at so many times the turns, and twice that."""
BREATHES: Seconds = 1.5
"""How long a motor's speed takes to rise and fall, by 3 %."""
SYLLABLES: Hertz = 4.0
"""Syllables a second of the made-up speech."""
VOWELS: tuple[tuple[Hertz, Hertz, Hertz], ...] = (
    (730.0, 1090.0, 2440.0),
    (270.0, 2290.0, 3010.0),
    (530.0, 1840.0, 2480.0),
    (570.0, 840.0, 2410.0),
    (300.0, 870.0, 2240.0),
)
"""First three formants of a man's vowels.

Peterson and Barney (1952), Control methods used in a study of the vowels, J. Acoust. Soc. Am. 24, 175.
"""


def motor(stream: np.random.Generator, size: int, sample_rate: float) -> Floats:
    """Return the sound (n,) of a small geared motor, of unit level.

    The harmonics of its turns, the mesh of its gear, and a hiss from 1 to 6 kHz. The speed wavers, so that no
    line of it stands still.

    Examples
    --------
    >>> sound = motor(np.random.default_rng(0), 4410, 44100.0)
    >>> sound.shape, round(float(np.mean(sound**2)), 6)
    ((4410,), 1.0)
    """
    time = np.arange(size) / sample_rate
    wavers = np.sin(2 * np.pi * time / BREATHES + stream.uniform(0.0, 6.0))
    speed = stream.uniform(*TURNS) * (1.0 + 0.03 * wavers)
    phase = 2 * np.pi * np.cumsum(speed) / sample_rate
    lines = {**{k: 1.0 / k for k in range(1, 9)}, TEETH: 0.8, 2 * TEETH: 0.4, 3 * TEETH: 0.2}
    waves = sum(
        (weight * np.sin(k * phase + stream.uniform(0.0, 2 * np.pi)) for k, weight in lines.items()),
        np.zeros(size),
    )
    hiss = band(stream, (size,), sample_rate, low=1000.0, high=6000.0)
    return _unit(waves + 0.4 * hiss * (1.0 + 0.5 * np.sin(TEETH * phase)))


def babble(stream: np.random.Generator, size: int, sample_rate: float) -> Floats:
    """Return made-up speech (n,) of unit level.

    Vowels of a gliding voice, and hisses, in syllables and pauses: pitch, formants and rhythm of speech, but
    no words, for where no recording is at hand.

    Examples
    --------
    >>> sound = babble(np.random.default_rng(0), 44100, 44100.0)
    >>> sound.shape, round(float(np.mean(sound**2)), 6)
    ((44100,), 1.0)
    """
    whole = np.zeros(size)
    length = round(sample_rate / SYLLABLES)
    time = np.arange(length) / sample_rate
    swell = np.sin(np.pi * np.arange(length) / length) ** 2
    for start in range(0, size, length):
        if start and stream.random() < 0.2:
            continue  # a pause
        pitch = stream.uniform(90.0, 140.0) * (1.0 - 0.2 * time * SYLLABLES)
        phase = 2 * np.pi * np.cumsum(pitch) / sample_rate
        formants = np.array(VOWELS[int(stream.integers(len(VOWELS)))])
        number = np.arange(1, 31)
        heights = (1.0 / (1.0 + ((number[:, None] * pitch.mean() - formants) / 80.0) ** 2)).sum(axis=1)
        voice = (heights / number) @ np.sin(number[:, None] * phase)
        syllable = swell * voice / np.sqrt(np.mean(voice**2))
        if stream.random() < 0.4:
            quarter = length // 4
            syllable[:quarter] += 0.3 * band(stream, (quarter,), sample_rate, low=3000.0, high=8000.0)
        whole[start : start + length] += syllable[: size - start]
    return _unit(whole)


def _unit(sound: Floats) -> Floats:
    return sound / np.sqrt(np.mean(sound**2))
