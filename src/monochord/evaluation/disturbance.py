"""Noise of a steady level, added to a whole session, the same at every ratio and for every estimator."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from monochord.core.errors import InputError, did_you_mean
from monochord.core.types import Audio, Floats
from monochord.dsp.noise import NOISES
from monochord.evaluation.room_sounds import babble, motor

MADE = {"motor": motor, "speech": babble}
"""Sounds that are made up where no recording of this name is given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """What is added to every session: a `kind` of sound at a `ratio` in dB.

    The noise has one level throughout; the ratio is that of the mean power of the session's touched windows,
    over both microphones, to the noise's. So single windows are worse and better off, as in a room. What is
    drawn depends on `seed`, the kind and the session's name alone: the same noise at every ratio, for every
    estimator. Microphones get independent noise of "white", "pink" and "band" and the same of all else.

    Parameters
    ----------
    kind
        Of `monochord.dsp.noise.NOISES`, "motor", "speech", or a name of `recordings`.
    ratio
        Signal to noise in dB.
    seed
        Of what is drawn.
    recordings
        Sounds (n,) by name, at the sessions' rate; they go round from a place that is drawn.

    Raises
    ------
    InputError
        For an unknown kind, a ratio out of range, or a recording that is silent.

    Examples
    --------
    >>> quiet = np.zeros((2, 4410), np.float32)
    >>> noisy = Disturbance(kind="hum", ratio=10.0).added(quiet, 1.0, 44100, "take")
    >>> round(float(np.mean(np.square(noisy, dtype=float))), 3)
    0.1
    """

    kind: str
    ratio: float
    seed: int = 0
    recordings: Mapping[str, Audio] = field(default_factory=dict[str, Audio])

    def __post_init__(self) -> None:
        known = disturbances(self.recordings)
        if self.kind not in known:
            raise InputError(f"noise '{self.kind}'", ", ".join(known), did_you_mean(self.kind, known))
        if not -60.0 <= self.ratio <= 120.0:
            raise InputError(f"noise at {self.ratio:g} dB", "-60 to 120 dB")
        sound = self.recordings.get(self.kind)
        if sound is not None and not (np.isfinite(sound).all() and np.any(sound)):
            raise InputError(f"recording of {self.kind} (silent, or not numbers)", "one with sound in it")

    def added(self, audio: Audio, power: float, sample_rate: int, session: str) -> Audio:
        """Return sound (2, n) with noise added; the ratio refers to `power`, of full scale squared."""
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
            going_round = np.resize(np.roll(recording.astype(np.float64), -start), size)
            return np.broadcast_to(_unit(going_round), shape)
        made = MADE.get(self.kind)
        long = _fast(size)  # an awkward length costs a Fourier transform ten times as much
        if made is not None:
            return np.broadcast_to(_unit(made(stream, long, float(sample_rate))[:size]), shape)
        return _unit(NOISES[self.kind](stream, (*shape[:-1], long), float(sample_rate))[..., :size])


def disturbances(recordings: Mapping[str, Audio] | None = None) -> tuple[str, ...]:
    """Return the kinds that there are, with recordings (n,) by name.

    >>> disturbances()
    ('white', 'pink', 'hum', 'band', 'motor', 'speech')
    """
    return tuple(dict.fromkeys([*NOISES, *MADE, *(recordings or {})]))


def _fast(size: int) -> int:
    """Return the next length from `size` on that is a power of two, or that times 5/8, 3/4 or 7/8."""
    whole = 1 << max(size - 1, 7).bit_length()
    return min(length for length in (whole * 5 // 8, whole * 3 // 4, whole * 7 // 8, whole) if length >= size)


def _unit(sound: Floats) -> Floats:
    return sound / np.sqrt(np.mean(sound**2, axis=-1, keepdims=True))
