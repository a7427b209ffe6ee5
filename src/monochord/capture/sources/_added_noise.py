"""Looped noise added to simulated sound during playback."""

import math
import threading

import numpy as np

from monochord.core.types import Audio
from monochord.core.units import Samples
from monochord.dsp.noise import NOISES, noise_loop

ADAPTATION = 0.01
"""Weight of a block's power in the running mean that sets the noise level."""


class AddedNoise:
    """Noise of a kind in `monochord.dsp.noise`, at a given ratio to the sound's loudness.

    The loudness is averaged over some seconds. Four seconds of each kind are generated in a separate thread,
    since some kinds take half a second: until then no noise is added. The loop repeats without a jump,
    equally loud in all channels.
    """

    def __init__(self, sample_rate: int, seed: int) -> None:
        self._sample_rate, self._seed = sample_rate, seed
        self._loops: dict[str, Audio | None] = {}
        self._power = 0.0
        self._gain = 0.0

    def added(self, sound: Audio, start: Samples, kind: str, ratio: float) -> Audio:
        """Return a sound (channels, n) that begins at frame `start`, with noise `ratio` dB below it.

        The noise level changes linearly over a block, without a jump between blocks.
        """
        power = float(np.mean(np.square(sound, dtype=np.float64)))
        self._power += (power - self._power) * (ADAPTATION if self._power else 1.0)
        loop = self._loop(kind, len(sound))
        if loop is None:
            return sound
        count = sound.shape[1]
        before, self._gain = self._gain, math.sqrt(self._power) * 10.0 ** (-0.05 * ratio)
        gain = np.linspace(before, self._gain, count, endpoint=False)
        noise = gain * loop[:, np.arange(start, start + count) % loop.shape[1]]
        return (sound + noise).astype(np.float32)

    def _loop(self, kind: str, channels: int) -> Audio | None:
        """Return the loop of a kind, None while it is being generated."""
        if kind not in self._loops:
            self._loops[kind] = None
            name = f"noise-{kind}"
            threading.Thread(target=self._make, args=(kind, channels), name=name, daemon=True).start()
        return self._loops[kind]

    def _make(self, kind: str, channels: int) -> None:
        random, rate = np.random.default_rng([self._seed, 5]), float(self._sample_rate)
        loop = noise_loop(NOISES[kind], random, (channels, self._sample_rate // 2), rate)
        self._loops[kind] = loop.astype(np.float32)
