"""A ring buffer of audio periods: one thread writes, one reads, neither waits for the other."""

from dataclasses import dataclass

import numpy as np

from monochord.capture.jack.arena import CONSUMED, OVERFLOWED, PUBLISHED, READ, WRITTEN, Arena
from monochord.capture.jack.atomics import load, store
from monochord.core.types import Audio
from monochord.core.units import Samples

FRAME_TIME_SPAN = 1 << 32  # a device's frame count is a 32-bit number


@dataclass(frozen=True, slots=True, kw_only=True)
class Period:
    """One callback's data: samples (channels, n), the device's frame count and clock (0: unknown)."""

    samples: Audio
    frame_time: Samples
    microseconds: int = 0


class Ring:
    """A ring for at least `frames` frames of `channels` channels, in periods of `shortest` frames or more.

    Counts of frames and periods only increase; the index in the ring is the count modulo its size, a power of
    two. `arena` is the memory that a compiled callback writes, in the same way as `put`.

    >>> ring = Ring(1, 64)
    >>> ring.put(Period(samples=np.ones((1, 16), np.float32), frame_time=480))
    True
    >>> ring.pending
    16
    >>> ring.take().frame_time
    480
    """

    def __init__(self, channels: int, frames: Samples, shortest: Samples = 16) -> None:
        capacity = 1 << (max(frames, shortest, 2) - 1).bit_length()
        self.arena = Arena(channels, capacity, max(capacity // shortest, 2))

    @property
    def pending(self) -> Samples:
        """Frames written but not yet read."""
        words = self.arena.words
        return int(words[WRITTEN] - words[READ]) if load(words, PUBLISHED) else 0

    def put(self, period: Period) -> bool:
        """Write one period and wake the reader; if it does not fit, count its frames and return False."""
        words, frames = self.arena.words, period.samples.shape[1]
        published, written = int(words[PUBLISHED]), int(words[WRITTEN])
        full = published - load(words, CONSUMED) >= len(self.arena.headers)
        if full or written - load(words, READ) + frames > self.arena.samples.shape[1]:
            words[OVERFLOWED] += frames
            return False
        slot, first = self._place(written, frames)
        self.arena.samples[:, slot : slot + first] = period.samples[:, :first]
        self.arena.samples[:, : frames - first] = period.samples[:, first:]
        header = (period.frame_time, period.microseconds, frames, written)
        self.arena.headers[published % len(self.arena.headers)] = header
        words[WRITTEN] = written + frames
        store(words, PUBLISHED, published + 1)
        self.arena.wake()
        return True

    def take(self) -> Period | None:
        """Return the oldest period with its samples copied, or None where the ring is empty."""
        words, consumed = self.arena.words, int(self.arena.words[CONSUMED])
        if load(words, PUBLISHED) == consumed:
            return None
        header = self.arena.headers[consumed % len(self.arena.headers)].tolist()
        frame_time, microseconds, frames, begin = header
        slot, first = self._place(begin, frames)
        samples = np.empty((self.arena.samples.shape[0], frames), np.float32)
        samples[:, :first] = self.arena.samples[:, slot : slot + first]
        samples[:, first:] = self.arena.samples[:, : frames - first]
        store(words, READ, begin + frames)
        store(words, CONSUMED, consumed + 1)
        return Period(samples=samples, frame_time=frame_time, microseconds=microseconds)

    def _place(self, begin: Samples, frames: Samples) -> tuple[int, Samples]:
        """Return where a period begins in the ring, and how many of its frames fit before the ring's end."""
        capacity = self.arena.samples.shape[1]
        return begin % capacity, min(frames, capacity - begin % capacity)


def frames_between(earlier: Samples, later: Samples) -> Samples:
    """Return the signed advance of a device's 32-bit frame count, across its wrap.

    >>> frames_between(2**32 - 10, 54)
    64
    """
    half = FRAME_TIME_SPAN // 2
    return (later - earlier + half) % FRAME_TIME_SPAN - half
