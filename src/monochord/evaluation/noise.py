"""Adds noise to whole sessions for an evaluation, at a given signal-to-noise ratio.

The noises of `monochord.dsp.noise`, a synthetic motor and synthetic speech, and recordings of music and
speech where they are available.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError, did_you_mean
from monochord.core.ranges import Checked
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Seconds
from monochord.dsp.noise import NOISES, STEADY, geared_motor
from monochord.dsp.speech import babble
from monochord.evaluation.recordings import interference_recordings, resampled, takes

SUITE_RATIOS = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0)
"""Signal-to-noise ratios of the noise suite, in dB."""
RECORDED = {"music": "Kevin_MacLeod", "speech": "198_209"}
"""Name prefixes of the interference recordings, by kind."""
MOTOR_SPEEDS: tuple[Hertz, Hertz] = (35.0, 55.0)
"""Speed range of the synthetic motor, in revolutions per second."""
SPEED_PERIOD: Seconds = 1.5
"""Period of the motor's 3 % speed variation, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance(Checked):
    """Noise of one `kind`, added to every session at a `ratio` of -60 to 120 dB.

    The noise level is constant over a session: the ratio compares the mean power of the session's touched
    windows, over both microphones, with the power of the noise. Single windows therefore have higher and
    lower ratios, as they would beside a loudspeaker. The noise depends only on `seed`, the kind and the
    session's name, so it is the same at every ratio and for every estimator. "white", "pink" and "band" are
    independent in both microphones; all other kinds are the same in both.

    A kind is a name of `monochord.dsp.noise.STEADY`, "motor", "speech", or one of `recordings`: sounds (n,)
    at the sample rate of the sessions, each repeated from a random position. A silent one raises
    `InputError`.

    >>> quiet = np.zeros((2, 4410), np.float32)
    >>> noisy = Disturbance(kind="hum", ratio=10.0).apply(quiet, 1.0, 44100, "take")
    >>> round(float(np.mean(np.square(noisy, dtype=float))), 3)
    0.1
    """

    kind: str
    ratio: Annotated[float, "dB", Meta(ge=-60.0, le=120.0)]
    seed: int = 0
    recordings: Mapping[str, Audio] = field(default_factory=dict[str, Audio])

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        known = noise_kinds(self.recordings)
        if self.kind not in known:
            raise InputError(f"noise '{self.kind}'", ", ".join(known), did_you_mean(self.kind, known))
        sound = self.recordings.get(self.kind)
        if sound is not None and not (np.isfinite(sound).all() and np.any(sound)):
            raise InputError(
                f"recording of {self.kind} (silent, or not finite)", "finite samples with a level above zero"
            )

    def apply(self, audio: Audio, power: float, sample_rate: int, session: str) -> Audio:
        """Return sound (2, n) with noise added; the ratio refers to `power`, in full scale squared."""
        key = [zlib.crc32(text.encode()) for text in (self.kind, session)]
        stream = np.random.default_rng([self.seed, *key])
        noise = self._sound(stream, audio.shape, sample_rate)
        gain = np.sqrt(power) * 10.0 ** (-self.ratio / 20.0)
        return (audio + gain * noise).astype(np.float32)

    def _sound(self, stream: np.random.Generator, shape: tuple[int, ...], sample_rate: int) -> Floats:
        size = shape[-1]
        recording = self.recordings.get(self.kind)
        if recording is not None:
            start = int(stream.integers(len(recording)))
            repeated = np.resize(np.roll(recording.astype(np.float64), -start), size)
            return np.broadcast_to(_unit_level(repeated), shape)
        padded = _fast_length(size)  # a Fourier transform of an awkward length takes ten times as long
        synthetic = SYNTHETIC.get(self.kind)
        if synthetic is not None:
            return np.broadcast_to(_unit_level(synthetic(stream, padded, float(sample_rate))[:size]), shape)
        return _unit_level(NOISES[self.kind](stream, (*shape[:-1], padded), float(sample_rate))[..., :size])


def noise_kinds(recordings: Mapping[str, Audio] | None = None) -> tuple[str, ...]:
    """Return the kinds of noise: built-in ones, and recordings (n,) by name.

    >>> noise_kinds()
    ('white', 'pink', 'hum', 'band', 'motor', 'speech')
    """
    return tuple(dict.fromkeys([*STEADY, *SYNTHETIC, *(recordings or {})]))


def parse_noise(text: str, recordings: Mapping[str, Audio], seed: int = 0) -> Disturbance:
    """Return the noise of a text such as ``white:10``: a kind, and a ratio in dB.

    >>> parse_noise("white:10", {}).ratio
    10.0
    """
    kind, _, ratio = text.partition(":")
    known = dict.fromkeys([*noise_kinds(recordings), *RECORDED])
    if kind not in known:
        raise InputError(f"noise '{text}'", ", ".join(known), did_you_mean(kind, known))
    try:
        number = float(ratio)
    except ValueError as error:
        raise InputError(f"noise '{text}'", "KIND:DB", f"write {kind}:10") from error
    return Disturbance(kind=kind, ratio=number, seed=seed, recordings=recordings)


def noise_suite(
    recordings: Mapping[str, Audio], ratios: Sequence[float] = SUITE_RATIOS, seed: int = 0
) -> tuple[Disturbance, ...]:
    """Return every kind of noise at every ratio in dB.

    >>> len(noise_suite({}, ratios=(10.0,)))
    6
    """
    return tuple(
        Disturbance(kind=kind, ratio=ratio, seed=seed, recordings=recordings)
        for kind in noise_kinds(recordings)
        for ratio in ratios
    )


def noise_recordings(sample_rate: int, music: Audio | None = None) -> dict[str, Audio]:
    """Return the available recordings (n,) of music and of speech, by kind.

    They are at `sample_rate`; `music`, at 44100 Hz, stands in for music where no recording is available.

    >>> set(noise_recordings(44100)) <= {"music", "speech"}
    True
    """
    recorded = interference_recordings() if takes(kind="interference") else {}
    sounds = {} if music is None else {"music": music}
    for kind, stem in RECORDED.items():
        for name, sound in recorded.items():
            if name.startswith(stem):
                sounds[kind] = sound
    return {kind: resampled(sound, sample_rate) for kind, sound in sounds.items()}


def motor(stream: np.random.Generator, size: int, sample_rate: float) -> Floats:
    """Return the sound (n,) of a small geared motor, of unit level.

    It consists of harmonics of its speed, the gear mesh frequency, and noise from 1 to 6 kHz. The speed
    varies, so that no line is constant.

    Examples
    --------
    >>> sound = motor(np.random.default_rng(0), 4410, 44100.0)
    >>> sound.shape, round(float(np.mean(sound**2)), 6)
    ((4410,), 1.0)
    """
    time = np.arange(size) / sample_rate
    variation = np.sin(2 * np.pi * time / SPEED_PERIOD + stream.uniform(0.0, 6.0))
    speed = stream.uniform(*MOTOR_SPEEDS) * (1.0 + 0.03 * variation)
    return _unit_level(geared_motor(stream, speed, sample_rate))


SYNTHETIC = {"motor": motor, "speech": babble}
"""Synthetic sounds, used where no recording of this name is given."""


def _fast_length(size: int) -> int:
    """Return the smallest length of at least `size` that is 2^k, or 5/8, 3/4 or 7/8 of it."""
    whole = 1 << max(size - 1, 7).bit_length()
    return min(length for length in (whole * 5 // 8, whole * 3 // 4, whole * 7 // 8, whole) if length >= size)


def _unit_level(sound: Floats) -> Floats:
    return sound / np.sqrt(np.mean(sound**2, axis=-1, keepdims=True))
