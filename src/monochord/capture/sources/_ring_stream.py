"""An open device: a callback fills a ring, and the ring's periods are the blocks."""

import threading
import time
from abc import abstractmethod
from collections.abc import Iterator

from monochord.capture.jack.ring import Period, Ring
from monochord.capture.sources._timeline import Timeline
from monochord.capture.sources.base import Stream
from monochord.core.types import Block, Signal
from monochord.core.units import Samples, Seconds


class RingStream(Stream):
    """Blocks out of a ring that a device fills; one thread iterates at a time.

    A subclass knows the device: when its periods were at the converter, and what to do while none comes.
    """

    def __init__(self, signal: Signal, ring: Ring) -> None:
        self._signal, self._ring = signal, ring
        self._timeline = Timeline(signal.sample_rate)
        self._closed = threading.Event()
        self._reading = threading.Lock()

    @abstractmethod
    def _adc_time(self, period: Period) -> Seconds | None:
        """Return the monotonic time of a period's first frame at the converter, None where nobody knows."""

    @abstractmethod
    def _idle(self) -> None:
        """Look after the device, or wait a little, while the ring is empty; raise if it is gone for good."""

    def _leave(self) -> None:
        """Leave the device; where another closes it, before the stream, this may be left out."""

    @property
    def signal(self) -> Signal:
        """Rate and channels."""
        return self._signal

    @property
    def pending(self) -> Samples:
        """Frames in the ring."""
        return self._ring.pending

    def __iter__(self) -> Iterator[Block]:
        """Yield one block a period; waits for a device that is away."""
        while (block := self._next()) is not None:
            yield block

    def close(self) -> None:
        """End the iteration, from whatever thread or signal handler."""
        self._closed.set()
        self._ring.arena.wake()

    def release(self) -> None:
        """Close, wait until the reader has left, and leave the device."""
        self.close()
        with self._reading:
            self._leave()
            self._ring.arena.close()

    def _next(self) -> Block | None:
        with self._reading:
            while not self._closed.is_set():
                period = self._ring.take()
                if period:
                    return self._timeline.place(period, self._adc_time(period), time.monotonic())
                self._idle()
            return None
