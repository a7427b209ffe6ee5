"""An open file or simulation: as fast as possible, or at the pace of a clock."""

import math
import time
from abc import abstractmethod

from monochord.capture.sources._open_stream import OpenStream
from monochord.core.errors import InputError
from monochord.core.types import Audio, Block, Signal, StreamHealth
from monochord.core.units import Samples, Seconds

MIN_SPEED = 1e-3
"""Least speed of a stream, in times real time."""


class PacedStream(OpenStream):
    """Blocks of `block` frames at `speed` times real time, each delivered when its last frame is due.

    Speed 0 delivers as fast as possible. The stream ends at frame `end`, or earlier where the subclass, which
    reads or generates the frames, has no more.
    """

    def __init__(self, signal: Signal, *, block: Samples, speed: float, end: float = math.inf) -> None:
        if 0.0 < speed < MIN_SPEED:
            raise InputError(f"speed {speed:g}", f"0 for no limit, or {MIN_SPEED:g} or more")
        super().__init__(signal)
        self._block, self._speed, self._end = block, speed, end
        self._start: Samples = 0  # index of the next block's first frame
        self._dropped: Samples = 0
        self._gaps = 0
        self._began: Seconds | None = None  # when the pace began; None before the first block

    @abstractmethod
    def _read(self, frames: Samples) -> Audio:
        """Return the next frames, (channels, n): fewer at the end of the source, none after it."""

    def _lost(self) -> Samples:
        """Return how many frames are missing before the next block; nonzero only in a recording."""
        return 0

    @property
    def pending(self) -> Samples:
        """Frames in complete blocks that are due by the clock; zero at speed 0."""
        if not self._speed or self._began is None:
            return 0
        due = (time.monotonic() - self._began) * self._signal.sample_rate * self._speed
        return max(int((min(due, self._end) - self._start) // self._block) * self._block, 0)

    @property
    def paced(self) -> bool:
        """Whether the speed is limited."""
        return self._speed > 0.0

    @property
    def health(self) -> StreamHealth:
        """Frames delivered so far, and frames missing from a recording."""
        return StreamHealth(frames=self._start - self._dropped, dropped=self._dropped, gaps=self._gaps)

    def _next(self) -> Block | None:
        if self._began is None:
            self._began = time.monotonic()
        with self._reading:
            if self._closed.is_set() or self._start >= self._end:
                return None
            lost = self._lost()
            self._start += lost
            self._dropped += lost
            self._gaps += lost > 0
            samples = self._read(int(min(self._block, self._end - self._start)))
            if not samples.shape[1]:
                return None
            adc_time = self._await(self._start + samples.shape[1])
            block = Block(samples=samples, start=self._start, dropped=lost, adc_time=adc_time)
            self._start += samples.shape[1]
            return None if self._closed.is_set() else block

    def _await(self, stop: Samples) -> Seconds | None:
        """Wait until frame `stop` is due; return the time of the block's first frame, where real."""
        speed, rate, began = self._speed, self._signal.sample_rate, self._began
        if not speed or began is None:
            return None
        self._closed.wait(max(began + stop / (rate * speed) - time.monotonic(), 0.0))
        return began + self._start / rate if speed == 1.0 else None
