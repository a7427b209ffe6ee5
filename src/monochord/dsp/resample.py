"""Windows at another sample rate, each by itself and in one shot."""

from math import gcd

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Samples, Seconds

LEAD: Seconds = 0.01
"""Sound on either side of a window that the resampler's filter is given at the least."""


class Resampler:
    """Resample windows of one length, linear phase, each window by itself.

    Sample k of the result is the sound k / `new_rate` after the window's first frame. A window is cut out of
    a sound that goes on, and the filter needs some of what is outside: it is given the window's point
    reflections, 2 x[0] - x[k] before it and 2 x[n-1] - x[n-1-k] after it, or before it real sound where the
    caller has that. The filter is soxr's "HQ".

    Parameters
    ----------
    sample_rate, new_rate
        In Hz, whole numbers.
    size
        Frames of a window, those of `context` included.
    context
        How many of them, at the start, are there for the filter alone and not in the result; 10 ms suffice. A
        whole number of the stretches after which both rates meet: 441 frames from 44.1 to 16 kHz.

    Raises
    ------
    InputError
        If a rate is not above zero, nothing is left behind the context, or that is not such a stretch.

    Notes
    -----
    Measured on partials of 300 to 1500 Hz that reach to 7 kHz, 44.1 to 16 kHz, windows of 0.1 s: the largest
    error in the first 2 ms is 17 % of the peak (median) with nothing before the window, 0.6 % with the
    reflection (2 % at worst), and below 0.01 % with context.

    Examples
    --------
    >>> resampler = Resampler(sample_rate=44100, new_rate=16000, size=4410)
    >>> resampler(np.zeros((2, 4410), np.float32)).shape
    (2, 1600)
    """

    def __init__(self, *, sample_rate: int, new_rate: int, size: Samples, context: Samples = 0) -> None:
        if sample_rate < 1 or new_rate < 1:
            raise InputError(f"rates of {sample_rate} and {new_rate} Hz", "above 0 Hz")
        if not 0 <= context < size:
            raise InputError(f"{context} of {size} frames as context", "0 or more, and fewer than all")
        shared = gcd(sample_rate, new_rate)
        apart = sample_rate // shared  # frames after which both rates meet again
        if context % apart:
            raise InputError(f"{context} frames as context", f"a multiple of {apart} frames at these rates")
        self._rates, self._size = (sample_rate, new_rate), size
        self._lead = -(-round(LEAD * sample_rate) // apart) * apart
        self._first = (self._lead + context) * new_rate // sample_rate
        self.length: Samples = (size - context) * new_rate // sample_rate

    def __call__(self, samples: Audio) -> Audio:
        """Return a window (channels, size) at the new rate: (channels, length) float32."""
        if samples.shape[-1] != self._size:
            raise InputError(f"a window of {samples.shape[-1]} frames", f"{self._size} frames")
        import soxr  # noqa: PLC0415

        ends = ((0, 0), (self._lead, self._lead))
        wide = np.pad(samples.astype(np.float32, copy=False), ends, mode="reflect", reflect_type="odd")
        resampled = np.asarray(soxr.resample(wide.T, *self._rates, quality="HQ"), np.float32).T
        return np.ascontiguousarray(resampled[:, self._first : self._first + self.length])
