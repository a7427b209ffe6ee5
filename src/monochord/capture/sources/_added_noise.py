"""Noise that is added to a simulated sound while it plays, on and on."""

import math
import threading

import numpy as np

from monochord.core.types import Audio
from monochord.core.units import Samples
from monochord.dsp.noise import NOISES, noise_loop

ADAPTATION = 0.01
"""Share of a block's power in the running one, by which the level of the noise follows the sound."""


class AddedNoise:
    """Noise of any kind that `monochord.dsp.noise` has, at a ratio to the sound's own loudness.

    The loudness is that over some seconds. Of each kind four seconds are made, in a thread of its own, since
    some take as long as half a second: until then nothing is added. They are repeated without a jump, alike
    loud in all channels.
    """

    def __init__(self, sample_rate: int, seed: int) -> None:
        self._sample_rate, self._seed = sample_rate, seed
        self._loops: dict[str, Audio | None] = {}
        self._power = 0.0
        self._gain = 0.0

    def added(self, sound: Audio, start: Samples, kind: str, ratio: float) -> Audio:
        """Return a sound (channels, n) that begins at a frame with a kind of noise, `ratio` dB below it.

        Its level changes steadily over a block, and so not by a jump between two.
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
        """Return the loop of a kind, None while it is being made."""
        if kind not in self._loops:
            self._loops[kind] = None
            name = f"noise-{kind}"
            threading.Thread(target=self._make, args=(kind, channels), name=name, daemon=True).start()
        return self._loops[kind]

    def _make(self, kind: str, channels: int) -> None:
        random, rate = np.random.default_rng([self._seed, 5]), float(self._sample_rate)
        loop = noise_loop(NOISES[kind], random, (channels, self._sample_rate // 2), rate)
        self._loops[kind] = loop.astype(np.float32)
