"""Whether a window can be used at all, and whether touches of a stream may be stated."""

import math

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.silence import SILENT_LEVEL
from monochord.core.types import Audio, Window
from monochord.core.units import Samples, Seconds

CLIPPED_SHARE = 0.1
"""Share of samples at the very top and bottom values from which a window is too clipped to trust."""
PATIENCE: Seconds = 3.0
"""How long a stream may begin with a touch. A string that is more than a tenth out of tune always sounds like
one that is touched."""


def unusable_reason(window: Window) -> str:
    """Return why a window cannot be used, or an empty string.

    >>> quiet = Window(samples=np.zeros((2, 4410), np.float32), start=0, sample_rate=44100)
    >>> unusable_reason(quiet)
    'silence'
    """
    if window.has_gap:
        return "gap"
    deviation, extreme = _measured(window.samples)
    if not math.isfinite(deviation):
        return "samples that are not numbers"
    if deviation < SILENT_LEVEL:
        return "silence"
    if extreme > CLIPPED_SHARE:
        return "clipped"
    return ""


class Hearing:
    """Whether a stream's touches may be stated: its untouched string was heard, or may still be to come.

    Examples
    --------
    >>> may_state = Hearing(sample_rate=44100)
    >>> [may_state(round(44100 * at), heard=at == 6.0) for at in (0.0, 2.0, 5.0, 6.0, 7.0)]
    [True, True, False, True, True]
    """

    def __init__(self, sample_rate: int) -> None:
        self._patience = PATIENCE * sample_rate
        self._first = self._last = -1
        self._heard = False

    def __call__(self, start: Samples, *, heard: bool) -> bool:
        """Return whether touches may be stated in a window; see `Estimator.prepare` on streams.

        `start` is the window's first frame. `heard` says whether the untouched string is known there.
        """
        if start <= self._last or self._last < 0:
            self._first, self._heard = start, False
        self._last, self._heard = start, self._heard or heard
        return self._heard or start - self._first <= self._patience


@kernel(fastmath={"reassoc"})
def _measured(samples: Audio) -> tuple[float, float]:
    """Return the largest standard deviation of a channel, and the share of samples at the extreme values.

    Samples are indexed, since of a channel as an iterator LLVM takes only one at a time.
    """
    channels, size = samples.shape
    deviation = 0.0
    for c in range(channels):
        total = square = 0.0
        for i in range(size):
            total += samples[c, i]
        mean = total / size
        if not np.isfinite(mean):
            return np.nan, 0.0
        for i in range(size):
            square += (samples[c, i] - mean) ** 2
        deviation = max(deviation, np.sqrt(square / size))
    low, high = _extremes(samples)
    extreme = 0
    for c in range(channels):
        for i in range(size):
            extreme += (samples[c, i] == low) | (samples[c, i] == high)
    return deviation, extreme / samples.size


@part(fastmath={"nnan", "nsz"})
def _extremes(samples: Audio) -> tuple[float, float]:
    """Return the lowest and the highest sample; all are numbers."""
    low = high = samples[0, 0]
    for c in range(samples.shape[0]):
        for i in range(samples.shape[1]):
            low, high = min(low, samples[c, i]), max(high, samples[c, i])
    return low, high
