"""The log-mel spectrogram that YAMNet was trained on."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Hertz, Samples
from monochord.dsp.mel import MEL_RATE, frame_indices, mel_filters

FRAME: Samples = 400
FFT_SIZE: Samples = 512
BANDS = 64
LOWEST: Hertz = 125.0
HIGHEST: Hertz = 7500.0
FLOOR = 1e-3
"""What is added to the magnitude of each band, so that silence has a logarithm."""
PATCH = 96
"""Frames of the patches that it was trained on."""


class YamnetMel:
    """Log-mel magnitudes, ln(m + 0.001), of 64 bands from 125 to 7500 Hz, of frames of 25 ms.

    Of each frame: a periodic Hann window, the magnitude of the Fourier transform of 512 points, triangular
    filters of height one on the mel scale. No mean is taken off and nothing is emphasised.

    Parameters
    ----------
    size
        Samples of a signal, at 16 kHz.
    hop
        Samples from frame to frame: 160, as in training, or 16, which makes 100 frames of 0.1 s.
    centred
        Frames as `monochord.dsp.mel.frame_indices` has them.

    Raises
    ------
    InputError
        If the signal is too short for a frame.

    References
    ----------
    M. Plakal and D. Ellis, YAMNet (2020), features.py and params.py.

    Examples
    --------
    >>> energies = YamnetMel(size=1600, hop=16)
    >>> energies(np.zeros((2, 1600), np.float32)).shape
    (2, 100, 64)
    """

    def __init__(self, *, size: Samples, hop: Samples, centred: bool = True) -> None:
        self._indices = frame_indices(size, frame=FRAME, hop=hop, centred=centred)
        if not self._indices.size:
            raise InputError(
                f"{1e3 * size / MEL_RATE:g} ms of sound", "a frame or more", "use a longer window"
            )
        self._size = size
        self._window = np.hanning(FRAME + 1)[:-1]
        self._filters = mel_filters(
            BANDS, fft_size=FFT_SIZE, sample_rate=MEL_RATE, lowest=LOWEST, highest=HIGHEST
        ).T.copy()

    @property
    def frames(self) -> int:
        """How many frames a signal has."""
        return self._indices.shape[0]

    @property
    def bands(self) -> int:
        """How many bands a frame has."""
        return self._filters.shape[1]

    def __call__(self, signal: Audio) -> Audio:
        """Return the log-mel magnitudes (channels, frames, 64) float32 of a signal (channels, size)."""
        if signal.shape[-1] != self._size:
            raise InputError(f"a signal of {signal.shape[-1]} samples", f"{self._size} samples")
        frames = signal.astype(np.float64)[:, self._indices] * self._window
        magnitude = np.abs(np.fft.rfft(frames, FFT_SIZE))
        return np.log(magnitude @ self._filters + FLOOR).astype(np.float32)
