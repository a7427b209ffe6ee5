"""Log-mel energies of a window, pooled over time but not over frequency."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta

from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.perception.features.base import Extractor, Feature
from monochord_encoders.mel import FINE_HOP, Spectrogram


@dataclass(frozen=True, slots=True, kw_only=True)
class LogMel(Feature):
    """Mean and maximum over time of each mel band's log energy, for each microphone.

    Bands are kept apart because a touch changes frequency. A window is resampled to 16 kHz and cut into
    frames of 25 ms, 1 ms apart (100 frames for 0.1 s); see `monochord_encoders.mel.LogMel`. The defaults give
    512 columns for two microphones.

    Parameters
    ----------
    bins
        Mel bands from 20 Hz to 8 kHz.
    context
        Seconds at the start of each window that only settle the resampler.

    Examples
    --------
    >>> extract = LogMel(bins=64).prepare(Signal(sample_rate=44100, channels=2), 4410)
    >>> extract(np.zeros((3, 2, 4410), np.float32)).shape
    (3, 256)
    """

    bins: Annotated[int, Meta(ge=1, le=256)] = 128
    context: Seconds = 0.0

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Prepare filters and frames.

        Raises `InputError` for a sample rate below 16 kHz or a window shorter than one frame.
        """
        return _Pooled(
            Spectrogram(signal, size, hop=FINE_HOP, centred=True, bins=self.bins, context=self.context),
            self.bins,
        )


class _Pooled(Extractor):
    def __init__(self, spectrogram: Spectrogram, bins: int) -> None:
        self._spectrogram = spectrogram
        self._columns = tuple(
            f"mic {microphone + 1} {pooling} of band {band + 1}"
            for microphone in range(spectrogram.sound.channels)
            for pooling in ("mean", "max")
            for band in range(bins)
        )

    @property
    def columns(self) -> tuple[str, ...]:
        return self._columns

    def __call__(self, windows: Audio) -> Audio:
        windows = self._spectrogram.sound.check(windows)
        rows = np.empty((windows.shape[0], len(self._columns)), np.float32)
        for row, window in zip(rows, windows, strict=True):
            energies = self._spectrogram(window)
            row[:] = np.concatenate([energies.mean(axis=1), energies.max(axis=1)], axis=1).ravel()
        return rows
