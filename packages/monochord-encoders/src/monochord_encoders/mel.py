"""Mel spectrograms: filter bank, frames, and the log-mel energies used by audio transformers."""

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.shapes import batch
from monochord.core.types import Audio, Floats, Signal
from monochord.core.units import Hertz, Samples, Seconds
from monochord_encoders.resampling import Resampler

__all__ = ["MEL_RATE", "MelSound", "frame_indices", "mel_filters"]

MEL_RATE = 16000
"""Sample rate in Hz of the input of a log-mel spectrogram."""
FRAME: Samples = 400
FFT_SIZE: Samples = 512
LOWEST: Hertz = 20.0
PRE_EMPHASIS = 0.97
FLOOR = float(np.finfo(np.float32).eps)
"""Smallest energy of a band, so that the logarithm of silence is finite."""
FINE_HOP: Samples = 16
"""Samples from one frame to the next; a window of 0.1 s has 100 frames."""
MAX_SAMPLE = 1.0e3
"""Largest sample in full scale; larger ones are clipped."""


def mel(frequency: Floats) -> Floats:
    """Return frequencies in Hz on the mel scale, 1127 ln(1 + f / 700), as in HTK and Kaldi.

    Examples
    --------
    >>> round(float(mel(np.array([1000.0]))[0]), 1)
    1000.0
    """
    return 1127.0 * np.log1p(frequency / 700.0)


def mel_filters(bins: int, *, fft_size: Samples, sample_rate: int, lowest: Hertz, highest: Hertz) -> Floats:
    """Return triangular filters, evenly spaced and linear on the mel scale, each of height one.

    Filter b rises from centre b - 1 to one at its own centre and falls to centre b + 1, linearly in mel. The
    centres and the outer feet divide `lowest` to `highest` into bins + 1 equal parts in mel.

    Parameters
    ----------
    bins
        Number of filters.
    fft_size
        Length of the Fourier transform.
    sample_rate
        Sample rate in Hz.
    lowest, highest
        Feet of the first and the last filter in Hz.

    Returns
    -------
    Floats
        Filters (bins, fft_size // 2 + 1), to multiply by an amplitude or energy spectrum.

    Raises
    ------
    InputError
        If the band is outside 0 to half the sample rate, or `bins` is below 1.

    References
    ----------
    S. Young et al., The HTK Book (2006), section 5.4.

    Examples
    --------
    >>> mel_filters(128, fft_size=512, sample_rate=16000, lowest=20.0, highest=8000.0).shape
    (128, 257)
    """
    if bins < 1:
        raise InputError(f"{bins} mel bins", "1 or more")
    if not 0.0 <= lowest < highest <= 0.5 * sample_rate:
        given = f"mel bands from {lowest:g} to {highest:g} Hz"
        raise InputError(given, f"rising, within 0 and {0.5 * sample_rate:g} Hz")
    low, high = mel(np.array([lowest, highest])).tolist()
    corners = np.linspace(low, high, bins + 2)
    place = mel(np.arange(fft_size // 2 + 1, dtype=np.float64) * (sample_rate / fft_size))
    rising = (place - corners[:-2, None]) / (corners[1:-1] - corners[:-2])[:, None]
    falling = (corners[2:, None] - place) / (corners[2:] - corners[1:-1])[:, None]
    return np.maximum(np.minimum(rising, falling), 0.0)


def frame_indices(size: Samples, *, frame: Samples, hop: Samples, centred: bool) -> NDArray[np.intp]:
    """Return the sample indices of each frame of a signal.

    Uncentred frames begin at multiples of `hop` and lie completely within the signal: there are 1 + (size -
    frame) // hop. Centred frames have their middle at (t + 1/2) `hop`: there are (size + hop // 2) // hop,
    and beyond its ends the signal is mirrored, with its first and last sample repeated (Kaldi's
    ``snip_edges=False``).

    Returns
    -------
    NDArray
        (frames, frame), indices from 0 to size - 1; no frame where the signal is too short for one.

    Examples
    --------
    >>> frame_indices(1600, frame=400, hop=16, centred=True).shape
    (100, 400)
    >>> frame_indices(1600, frame=400, hop=160, centred=False).shape
    (8, 400)
    """
    count = (size + hop // 2) // hop if centred else max(1 + (size - frame) // hop, 0)
    first = hop // 2 - frame // 2 if centred else 0
    wanted = first + hop * np.arange(count)[:, None] + np.arange(frame)
    turn = wanted % (2 * size)
    return np.where(turn < size, turn, 2 * size - 1 - turn)


class LogMel:
    """Log-mel energies as in Kaldi and in the training of the Audio Spectrogram Transformer.

    For each frame of 25 ms: subtract the mean, apply x[k] - 0.97 x[k-1] and a symmetric Hann window, take the
    energy spectrum of 512 points, triangular mel filters from 20 Hz to 8 kHz, and the natural logarithm.
    There is no dither.

    Parameters
    ----------
    size
        Length of the signal in samples at `MEL_RATE`.
    hop
        Hop in samples: 160, as in AudioSet, or 16, which gives 100 frames in 0.1 s.
    bins
        Mel bands.
    centred
        Whether frames are centred, see `frame_indices`.

    Raises
    ------
    InputError
        If the signal is too short for a frame.

    References
    ----------
    D. Povey et al., The Kaldi speech recognition toolkit (2011); Y. Gong, Y.-A. Chung and J. Glass, AST:
    Audio Spectrogram Transformer (2021).

    Examples
    --------
    >>> energies = LogMel(size=1600, hop=16, centred=True)
    >>> energies(np.zeros((2, 1600), np.float32)).shape
    (2, 100, 128)
    """

    def __init__(self, *, size: Samples, hop: Samples, bins: int = 128, centred: bool = False) -> None:
        self._indices = frame_indices(size, frame=FRAME, hop=hop, centred=centred)
        if not self._indices.size:
            shortest = hop if centred else FRAME
            given = f"{1e3 * size / MEL_RATE:g} ms of sound"
            raise InputError(given, f"{1e3 * shortest / MEL_RATE:g} ms or more for a mel spectrogram")
        self._size = size
        self._window = np.hanning(FRAME)
        from scipy.sparse import csr_array  # noqa: PLC0415

        # Few of their weights are not zero; and a sparse product's bits do not depend on a number of threads.
        self._filters = csr_array(
            mel_filters(bins, fft_size=FFT_SIZE, sample_rate=MEL_RATE, lowest=LOWEST, highest=0.5 * MEL_RATE)
        )

    @property
    def frames(self) -> int:
        """Number of frames in a signal."""
        return self._indices.shape[0]

    def __call__(self, signal: Audio) -> Audio:
        """Return the log-mel energies (channels, frames, bins) float32 of a signal (channels, size)."""
        if signal.shape[-1] != self._size:
            raise InputError(f"a signal of {signal.shape[-1]} samples", f"{self._size} samples")
        frames = np.take(signal.astype(np.float64), self._indices, axis=-1)
        frames -= frames.mean(axis=-1, keepdims=True)
        frames[..., 1:] -= PRE_EMPHASIS * frames[..., :-1]
        frames[..., 0] *= 1.0 - PRE_EMPHASIS
        frames *= self._window
        spectrum = np.fft.rfft(frames.reshape(-1, FRAME), FFT_SIZE).T
        energy = self._filters @ np.ascontiguousarray(spectrum.real**2 + spectrum.imag**2)
        levels = np.log(np.maximum(energy, FLOOR)).T.astype(np.float32)
        return levels.reshape(*signal.shape[:-1], self.frames, -1)


class MelSound:
    """Windows of one length as sound at 16 kHz; the first `context` seconds only settle the resampler."""

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
        """Length of a window in samples at 16 kHz."""
        return self._resampler.length

    def check(self, windows: Audio) -> Audio:
        """Return windows as float32; raises `InputError` for a shape other than (n, channels, size)."""
        return batch(windows, self.channels, self._size)

    def __call__(self, window: Audio) -> Audio:
        """Return a window's sound (channels, length); non-finite samples become silence."""
        sound = np.clip(np.nan_to_num(window, nan=0.0, posinf=0.0, neginf=0.0), -MAX_SAMPLE, MAX_SAMPLE)
        return self._resampler(sound)


class Spectrogram:
    """Log-mel spectrograms of windows of one length: the input of `log_mel` and of the transformer."""

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
