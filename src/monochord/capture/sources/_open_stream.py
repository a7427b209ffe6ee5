"""A stream that a `with` block releases: what it reads is closed once its reader has left."""

import threading
from abc import abstractmethod
from collections.abc import Iterator
from typing import Self

from monochord.capture.sources.base import Stream
from monochord.core.types import Block, Signal


class OpenStream(Stream):
    """The blocks of a subclass; one thread iterates at a time, and any may close."""

    def __init__(self, signal: Signal) -> None:
        self._signal = signal
        self._closed = threading.Event()
        self._reading = threading.Lock()

    @abstractmethod
    def _next(self) -> Block | None:
        """Return the next block, None after the last; holds `_reading`."""

    def _leave(self) -> None:
        """Release what was opened; optional for a subclass."""

    @property
    def signal(self) -> Signal:
        """Rate, channels and, where known, the string."""
        return self._signal

    def __iter__(self) -> Iterator[Block]:
        """Yield the blocks in order."""
        while (block := self._next()) is not None:
            yield block

    def close(self) -> None:
        """End the iteration; may be called from any thread or signal handler."""
        self._closed.set()

    def release(self) -> None:
        """Close, wait until the reader has left, and release what was opened."""
        self.close()
        with self._reading:
            self._leave()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()
