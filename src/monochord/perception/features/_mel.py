"""Log-mel spectrograms of windows: the input of the feature `log_mel` and of the transformer."""

from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.dsp.mel import LogMel, MelSound

FINE_HOP: Samples = 16
"""Samples from one frame to the next; a window of 0.1 s has 100 frames."""


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
