"""Whether a window can be used at all, and whether touches of a stream may be stated."""

import math
from collections import deque

import numpy as np

from monochord.core.clipping import DISTORTED_SHARE
from monochord.core.clock import RATE_RATIOS
from monochord.core.kernels import kernel, part
from monochord.core.reasons import Reason
from monochord.core.silence import SILENT_LEVEL
from monochord.core.types import Audio, Floats, Indices, Window
from monochord.core.units import Samples, Seconds

STRONG_LINE = 1e-2
"""Least power of a line that must jump with the others, as a share of its channel's strongest."""
SAME_RATIO, SAME_LEVEL = 0.004, 0.5
"""Largest relative difference of lines in such a factor, and of their levels, in nats of power."""
PATIENCE: Seconds = 3.0
"""How long a stream may begin with a touch. A string that is more than a tenth out of tune always sounds like
one that is touched."""

_RATIOS = np.array(RATE_RATIOS)


def unusable_reason(window: Window) -> Reason:
    """Return why a window cannot be used; empty if it can.

    >>> quiet = Window(samples=np.zeros((2, 4410), np.float32), start=0, sample_rate=44100)
    >>> unusable_reason(quiet)
    'silence'
    """
    if window.has_gap:
        return Reason.GAP
    deviation, extreme = _measured(window.samples)
    if not math.isfinite(deviation):
        return Reason.NOT_NUMBERS
    if deviation < SILENT_LEVEL:
        return Reason.SILENCE
    if extreme > DISTORTED_SHARE:
        return Reason.CLIPPED
    return Reason.NONE


class UntouchedStringCheck:
    """Whether a stream's touches may be stated: its untouched string was heard, or may still be to come.

    Examples
    --------
    >>> may_state = UntouchedStringCheck(sample_rate=44100)
    >>> [may_state(round(44100 * at), heard=at == 6.0) for at in (0.0, 2.0, 5.0, 6.0, 7.0)]
    [True, True, False, True, True]
    """

    def __init__(self, sample_rate: int) -> None:
        self._patience = PATIENCE * sample_rate
        self._first = self._last = -1
        self._heard = self._lost = False

    def forget(self) -> None:
        """Wait for the untouched string to be heard anew: no touch is stated until then."""
        self._heard, self._lost = False, True

    def __call__(self, start: Samples, *, heard: bool) -> bool:
        """Return whether touches may be stated in a window; see `Estimator.prepare` on streams.

        `start` is the window's first frame. `heard` says whether the untouched string is known there.
        """
        if start <= self._last or self._last < 0:
            self._first, self._heard, self._lost = start, False, False
        self._last, self._heard = start, self._heard or heard
        return self._heard or (not self._lost and start - self._first <= self._patience)


class PitchJumps:
    """Whether a stream's sample rate changes: all in its windows jumps in pitch by one of `RATE_RATIOS`.

    A touch moves a string's lines by different factors, or changes their levels.

    Examples
    --------
    >>> jumps = PitchJumps()
    >>> frequency, height = np.array([[1000.0, 2000.0], [2000.0, 1000.0]]), np.ones((2, 2))
    >>> [jumps(4410 * k, 4410, c * frequency, height) for k, c in enumerate((1.0, 1.0, 0.919, 0.919))]
    [False, False, True, False]
    """

    def __init__(self) -> None:
        self._windows = deque[tuple[Samples, Floats, Floats]]()

    def __call__(self, start: Samples, size: Samples, frequency: Floats, height: Floats) -> bool:
        """Return whether a window's lines are those of the window before it at another pitch.

        `frequency` and `height` (channels, lines) are in Hz and in power, the strongest line first, zero
        where there is none. Windows that overlap with this one are left out. A window that starts no later
        than the last begins another stream.
        """
        known = self._windows
        if known and start <= known[-1][0]:
            known.clear()
        while len(known) > 1 and known[1][0] + size <= start:
            known.popleft()
        jumped = bool(known) and known[0][0] + size <= start and _is_jump(*known[0][1:], frequency, height)
        if jumped:
            known.clear()
        known.append((start, frequency, height))
        return jumped


@kernel()
def _is_jump(frequency_before: Floats, height_before: Floats, frequency: Floats, height: Floats) -> bool:
    """Return whether the strong lines of each channel have kept their levels and moved by one factor."""
    possible = np.ones(_RATIOS.size, np.bool_)
    for c in range(frequency.shape[0]):
        before, after = _strong(frequency_before[c], height_before[c]), _strong(frequency[c], height[c])
        if before.size == 0 or before.size != after.size:
            return False
        for one, two in zip(before, after):  # noqa: B905  (numba knows no strict)
            if abs(np.log(height[c, two] / height_before[c, one])) > SAME_LEVEL:
                return False
            ratio = frequency[c, two] / frequency_before[c, one]
            possible &= np.abs(ratio / _RATIOS - 1.0) < SAME_RATIO
    return bool(possible.any())


@part()
def _strong(frequency: Floats, height: Floats) -> Indices:
    """Return the strong lines of a channel, by frequency."""
    count = 0
    while count < height.size and height[count] > STRONG_LINE * height[0]:
        count += 1
    return np.argsort(frequency[:count])


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
