"""From a window to its log-mel spectrogram: what `log_mel` and the transformer have in common."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.dsp.mel import MEL_RATE, LogMel
from monochord.dsp.resample import Resampler

FINE: Samples = 16
"""Samples from frame to frame that make 100 frames of a tenth of a second."""
LOUDEST = 1.0e3
"""Samples beyond this many times full scale count as it."""


class Spectrogram:
    """Log-mel spectrograms of windows of one length; the first `context` of each only settles the filter."""

    def __init__(
        self, signal: Signal, size: Samples, *, hop: Samples, centred: bool, bins: int, context: Seconds
    ) -> None:
        if signal.sample_rate < MEL_RATE:
            raise InputError(f"a sample rate of {signal.sample_rate} Hz", f"{MEL_RATE} Hz or more")
        self.channels, self._size = signal.channels, size
        self._resampler = Resampler(
            sample_rate=signal.sample_rate,
            new_rate=MEL_RATE,
            size=size,
            context=round(context * signal.sample_rate),
        )
        self._energies = LogMel(size=self._resampler.length, hop=hop, bins=bins, centred=centred)

    @property
    def frames(self) -> int:
        """Frames of a window."""
        return self._energies.frames

    def refuse_other(self, windows: Audio) -> None:
        """Raise `InputError` for windows of another form than (n, channels, size)."""
        if windows.ndim != 3 or windows.shape[1:] != (self.channels, self._size):
            given = f"windows of shape {windows.shape}"
            raise InputError(given, f"(n, {self.channels}, {self._size})")

    def __call__(self, window: Audio) -> Audio:
        """Return the energies (channels, frames, bins) of a window; what is not a number is silence."""
        sound = np.clip(np.nan_to_num(window, nan=0.0, posinf=0.0, neginf=0.0), -LOUDEST, LOUDEST)
        return self._energies(self._resampler(sound))
