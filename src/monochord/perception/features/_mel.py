"""Log-mel spectrograms of windows: the input of `log_mel`, of the transformer and of YAMNet."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.shapes import batch
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.dsp.mel import MEL_RATE, LogMel
from monochord.dsp.resample import Resampler

FINE_HOP: Samples = 16
"""Samples from frame to frame that make 100 frames of a tenth of a second."""
MAX_SAMPLE = 1.0e3
"""Largest sample in full scale; larger ones are clipped to it."""


class MelSound:
    """Windows of one length as sound at 16 kHz; `context` seconds at the start only settle the resampler."""

    def __init__(self, signal: Signal, size: Samples, *, context: Seconds = 0.0) -> None:
        if signal.sample_rate < MEL_RATE:
            raise InputError(f"a sample rate of {signal.sample_rate} Hz", f"{MEL_RATE} Hz or more")
        self.channels, self._size = signal.channels, size
        frames = round(context * signal.sample_rate)
        self._resampler = Resampler(
            sample_rate=signal.sample_rate, new_rate=MEL_RATE, size=size, context=frames
        )

    @property
    def length(self) -> Samples:
        """Samples of a window at 16 kHz."""
        return self._resampler.length

    def check(self, windows: Audio) -> Audio:
        """Return windows as float32; raise `InputError` for another form than (n, channels, size)."""
        return batch(windows, self.channels, self._size)

    def __call__(self, window: Audio) -> Audio:
        """Return the sound (channels, length) of a window; samples that are not numbers are silence."""
        sound = np.clip(np.nan_to_num(window, nan=0.0, posinf=0.0, neginf=0.0), -MAX_SAMPLE, MAX_SAMPLE)
        return self._resampler(sound)


class Spectrogram:
    """Log-mel spectrograms of windows of one length."""

    def __init__(
        self, signal: Signal, size: Samples, *, hop: Samples, centred: bool, bins: int, context: Seconds
    ) -> None:
        self.sound = MelSound(signal, size, context=context)
        self._energies = LogMel(size=self.sound.length, hop=hop, bins=bins, centred=centred)

    @property
    def frames(self) -> int:
        """Frames of a window."""
        return self._energies.frames

    def __call__(self, window: Audio) -> Audio:
        """Return the energies (channels, frames, bins) of a window."""
        return self._energies(self.sound(window))
