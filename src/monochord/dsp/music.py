"""A synthetic music loop as ambient noise: drums, bass, chords and a melody."""

from functools import cache

import numpy as np

from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Seconds

BEATS_PER_MINUTE = 112.0
CHORDS = ((57, 60, 64), (53, 57, 60), (48, 52, 55), (55, 59, 62))
"""MIDI keys of the four chords, one bar each: A minor, F, C and G major, the most common in pop songs."""
SCALE = (69, 72, 74, 76, 79, 81)
"""MIDI keys of the melody: the minor pentatonic scale on A, and the octave."""
BARS = 8
LOUDNESS = 0.1
"""Rms of the loop in full scale."""


def loop(seed: int = 0, *, sample_rate: int = 44100) -> Audio:
    """Return about seventeen seconds of synthetic mono music that loops seamlessly.

    It has a kick drum on each beat, a snare on every second, a hi-hat on the half beats, a bass, sustained
    sawtooth-like chords, and a random melody. Its spectrum falls from the bass to some 10 kHz, like a mixed
    song's, and its level follows the beat.

    Parameters
    ----------
    seed
        Random seed of the melody and of the drums' noise.
    sample_rate
        Sample rate in Hz.

    Returns
    -------
    array
        Samples (n,) float32, with rms `LOUDNESS`.

    Examples
    --------
    >>> sound = loop(1)
    >>> sound.dtype.name, round(len(sound) / 44100, 2), round(float(np.sqrt(np.mean(sound**2))), 3)
    ('float32', 17.14, 0.1)
    """
    random, beat = np.random.default_rng([seed, 7]), 60.0 / BEATS_PER_MINUTE
    loop_ = np.zeros(round(4 * BARS * beat * sample_rate))
    time: Floats = np.arange(round(4 * beat * sample_rate)) / sample_rate

    @cache
    def tone(key: int, partials: int) -> Floats:
        return _tone(time, _pitch(key), partials)

    for bar in range(BARS):
        chord, start = CHORDS[bar % len(CHORDS)], 4 * bar * beat
        pad = sum((tone(key, 12) for key in chord), np.zeros_like(time))
        _add(loop_, start, 0.05 * pad * _swell(time, 4 * beat), sample_rate)
        for i in range(4):
            at = start + i * beat
            _add(loop_, at, _kick(time), sample_rate)
            if i % 2 == 1:
                _add(loop_, at, 0.5 * _burst(time, 0.09, random), sample_rate)
            for half in (0.0, 0.5):
                hat = np.diff(_burst(time, 0.02, random), prepend=0.0)
                _add(loop_, at + half * beat, 0.12 * hat, sample_rate)
                bass = tone(chord[0] - 24, 6) * np.exp(-time / 0.15)
                _add(loop_, at + half * beat, 0.35 * bass, sample_rate)
            note = tone(int(random.choice(SCALE)), 8) * np.exp(-time / 0.2)
            if random.uniform() < 0.8:
                _add(loop_, at + 0.5 * beat * int(random.integers(2)), 0.2 * note, sample_rate)
    return (LOUDNESS * loop_ / np.sqrt(np.mean(loop_**2))).astype(np.float32)


def _pitch(key: int) -> Hertz:
    return 440.0 * 2.0 ** ((key - 69) / 12.0)


def _tone(time: Floats, pitch: Hertz, partials: int) -> Floats:
    """Return a tone whose partial amplitudes fall as one over their number."""
    number = np.arange(1, partials + 1)
    return np.sin(2.0 * np.pi * pitch * np.outer(time, number)) @ (1.0 / number)


def _kick(time: Floats) -> Floats:
    phase = 2.0 * np.pi * (50.0 * time + 5.0 * (1.0 - np.exp(-time / 0.03)))
    return np.sin(phase) * np.exp(-time / 0.12)


def _burst(time: Floats, lasting: Seconds, random: np.random.Generator) -> Floats:
    return random.standard_normal(time.size) * np.exp(-time / lasting)


def _swell(time: Floats, length: Seconds) -> Floats:
    return np.minimum(1.0, np.minimum(time, length - time) / 0.05)


def _add(loop_: Floats, start: Seconds, sound: Floats, rate: int) -> None:
    """Add a sound to the loop from a time on; the part beyond the end wraps to the beginning."""
    at = (round(start * rate) + np.arange(sound.size)) % loop_.size
    loop_[at] += sound
