"""An open sound card, and the callback that fills its ring."""

import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from monochord.capture.jack.ring import FRAME_TIME_SPAN, Period, Ring
from monochord.capture.sources._ring_stream import RingStream
from monochord.core.clock import clock_offsets
from monochord.core.errors import DeviceError
from monochord.core.types import Signal, StreamHealth
from monochord.core.units import Samples, Seconds

RING: Seconds = 2.0
IDLE: Seconds = 0.5  # between looks at the device while no audio comes


class CallbackTimes(Protocol):
    """PortAudio's times of a block, in seconds on its own clock; zeros where unknown."""

    currentTime: Seconds  # noqa: N815
    inputBufferAdcTime: Seconds  # noqa: N815


class CallbackFlags(Protocol):
    """PortAudio's error flags of a block."""

    input_overflow: bool


class SoundcardStream(RingStream):
    """Blocks of a sound card; pass `capture` to PortAudio as the callback."""

    def __init__(self, sample_rate: int, channels: int) -> None:
        ring = Ring(channels, round(RING * sample_rate), shortest=1)
        super().__init__(Signal(sample_rate=sample_rate, channels=channels), ring)
        self._active: Callable[[], bool] = lambda: True
        self._frame_time: Samples = 0  # frames that the card brought or lost so far
        self._overflows = 0
        self._next_time: Seconds | None = None  # monotonic time at which the next frame was due

    @property
    def health(self) -> StreamHealth:
        """Counters so far; `xruns` counts the overflows that PortAudio reported."""
        away = "the sound card is silent"
        return self._timeline.health(
            xruns=self._overflows, reconnects=0, clock_offsets=clock_offsets(), away=away
        )

    def capture(self, frames: np.ndarray, count: int, times: CallbackTimes, status: CallbackFlags) -> None:
        """Copy one block, (count, channels), into the ring: PortAudio's callback.

        PortAudio reports that frames were lost but not how many: the converter's times give their number, at
        least one block. Without these times, the block's time of arrival is used.
        """
        now, rate = time.monotonic(), self._signal.sample_rate
        known = times.inputBufferAdcTime > 0.0
        began = now - (times.currentTime - times.inputBufferAdcTime if known else count / rate)
        if status.input_overflow:
            self._overflows += 1
            late = 0.0 if self._next_time is None else (began - self._next_time) * rate
            self._frame_time += max(round(late), count)
        microseconds = round(began * 1e6) if known else 0
        frame_time = self._frame_time % FRAME_TIME_SPAN
        self._ring.put(Period(samples=frames.T, frame_time=frame_time, microseconds=microseconds))
        self._frame_time += count
        self._next_time = began + count / rate

    def watch(self, active: Callable[[], bool]) -> None:
        """Set the function that reports whether the device is still running."""
        self._active = active

    def _adc_time(self, period: Period) -> Seconds | None:
        return period.microseconds * 1e-6 if period.microseconds else None

    def _idle(self) -> None:
        if not self._active():
            raise DeviceError("sound card: stopped; plug it in again and reopen it")
        self._ring.arena.wait(IDLE)
