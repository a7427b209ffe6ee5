"""An open device: a callback fills a ring, and each period becomes a block on the stream's clock."""

import time
from abc import abstractmethod
from collections.abc import Iterator

import numpy as np

from monochord.capture.jack.ring import FRAME_TIME_SPAN, Period, Ring, frames_between
from monochord.capture.sources._open_stream import OpenStream
from monochord.core.types import Block, Signal, StreamHealth
from monochord.core.units import Samples, Seconds

ABSENCE: Seconds = 1.0
"""Time without sound after which a device counts as away, in s."""
LAG: Seconds = 0.2
"""How far behind the clock lost frames of an absent device are counted, in s: newer ones may still arrive."""


class RingStream(OpenStream):
    """Blocks from a ring that a device fills.

    A subclass handles the device: the converter time of its periods, and what to do while none arrive.
    """

    def __init__(self, signal: Signal, ring: Ring) -> None:
        super().__init__(signal)
        self._ring = ring
        self._timeline = Timeline(signal.sample_rate)

    @abstractmethod
    def _adc_time(self, period: Period) -> Seconds | None:
        """Return the monotonic time of a period's first frame at the converter, None where unknown."""

    @abstractmethod
    def _idle(self) -> None:
        """Check the device or wait briefly while the ring is empty; raise if the device is lost for good."""

    def _leave(self) -> None:
        """Close the ring; a subclass closes its device first, unless that is closed elsewhere."""
        self._ring.arena.close()

    @property
    def pending(self) -> Samples:
        """Frames in the ring."""
        return self._ring.pending

    @property
    def paced(self) -> bool:
        """True: the device sets the pace."""
        return True

    def in_time(self) -> Iterator[Block]:
        """Yield one block per period and, for an absent device, the frames lost so far."""
        while (block := self._next(in_time=True)) is not None:
            yield block

    def close(self) -> None:
        """End the iteration; may be called from any thread or signal handler."""
        super().close()
        self._ring.arena.wake()

    def _next(self, *, in_time: bool = False) -> Block | None:
        with self._reading:
            while not self._closed.is_set():
                period, now = self._ring.take(), time.monotonic()
                if period:
                    return self._timeline.place(period, self._adc_time(period), now)
                if in_time and (lost := self._timeline.lose(self._signal.channels, now)):
                    return lost
                self._idle()
            return None


class Timeline:
    """Places periods on the stream's clock of `sample_rate` frames per second, and counts lost frames.

    While one device runs, its frame counter is used; after `interrupt`, when another counter begins, the
    monotonic clock gives the gap. `away` states that frames have been counted as lost since the last period,
    because none arrived for too long.
    """

    def __init__(self, sample_rate: int) -> None:
        self._rate = sample_rate
        self._end: Samples = 0  # index after the newest frame
        self._frame_time: Samples | None = None  # the device's count there
        self._time: Seconds | None = None  # the monotonic clock there; None before the first frame
        self._frames = self._dropped = self._gaps = 0
        self.away = False

    def interrupt(self) -> None:
        """Note that the device's counter restarts."""
        self._frame_time = None

    def place(self, period: Period, adc_time: Seconds | None, now: Seconds) -> Block:
        """Return the samples of one callback as a block.

        `adc_time` is the monotonic time of the period's first frame at the converter; where it is None, the
        current monotonic time `now` counts as the last frame's. The period's `frame_time` counts modulo 2^32.
        """
        frames = period.samples.shape[1]
        began = now - frames / self._rate if adc_time is None else adc_time
        lost = self._lost(period.frame_time, began)
        start = self._end + lost
        self._end, self._time = start + frames, began + frames / self._rate
        self._frame_time = (period.frame_time + frames) % FRAME_TIME_SPAN
        self._frames += frames
        self._dropped += lost
        self._gaps += lost > 0 and not self.away
        self.away = False
        return Block(
            samples=period.samples,
            start=start,
            dropped=lost,
            adc_time=adc_time,
            frame_time=period.frame_time,
        )

    def lose(self, channels: int, now: Seconds) -> Block | None:
        """Return the frames lost so far as a block without samples, once no period arrives for too long."""
        if self._time is None or now - self._time < (ABSENCE if not self.away else 2 * LAG):
            return None
        lost = int((now - LAG - self._time) * self._rate)
        self._end += lost
        self._time += lost / self._rate
        if self._frame_time is not None:
            self._frame_time = (self._frame_time + lost) % FRAME_TIME_SPAN
        self._dropped += lost
        self._gaps += not self.away
        self.away = True
        return Block(samples=np.zeros((channels, 0), np.float32), start=self._end, dropped=lost)

    def health(
        self, *, xruns: int, reconnects: int, clock_offsets: dict[str, Seconds], away: str = ""
    ) -> StreamHealth:
        """Return the counters so far with the device's; `away` is the message shown for an absent device."""
        return StreamHealth(
            frames=self._frames,
            dropped=self._dropped,
            gaps=self._gaps,
            xruns=xruns,
            reconnects=reconnects,
            clock_offsets=clock_offsets,
            away=away if self.away else "",
        )

    def _lost(self, frame_time: Samples, began: Seconds) -> Samples:
        if self._time is None:
            return 0
        if self._frame_time is None:
            lost = round((began - self._time) * self._rate)
        else:
            lost = frames_between(self._frame_time, frame_time)
        return max(lost, 0)  # a count may step back a little after an xrun; indices never do
