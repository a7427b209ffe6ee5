"""Control-C, SIGTERM and SIGHUP as a request that a loop checks between two steps."""

import signal
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption:
    """Whether the user or the system requested the end of a run; a second signal raises at once.

    A KeyboardInterrupt can be raised anywhere, and becomes another error inside a compiled kernel. So the
    first signal only sets `requested` and closes the stream, which may be waiting for a block that never
    comes.
    """

    def __init__(self) -> None:
        self.requested = False
        self._at_once = False
        self._close: Callable[[], None] | None = None
        self._closing: threading.Thread | None = None

    @contextmanager
    def ending(self, close: Callable[[], None]) -> Generator[None]:
        """Call `close` from a separate thread once the end is requested."""
        self._close = close
        if self.requested:
            close()
        try:
            yield
        finally:
            self._close = None
            if self._closing:
                self._closing.join()

    @contextmanager
    def at_once(self) -> Generator[None]:
        """Make the first signal raise too, while devices are opened and there is nothing to save yet."""
        self._at_once = True
        try:
            if self.requested:
                raise KeyboardInterrupt
            yield
        finally:
            self._at_once = False

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Take a signal."""
        if self.requested or self._at_once:
            signal.default_int_handler(number, frame)
        self.requested = True
        if self._close:
            # The interrupted code may hold a lock that closing wants, and goes on only after this returns.
            self._closing = threading.Thread(target=self._close, daemon=True)
            self._closing.start()


@contextmanager
def interruption() -> Generator[Interruption]:
    """Handle SIGINT, SIGTERM and SIGHUP, and restore the previous handlers afterwards.

    An ignored signal, such as SIGHUP under nohup, stays ignored. Outside the main thread, where Python
    receives no signals, nothing changes.
    """
    stop = Interruption()
    before = {}
    with suppress(ValueError):  # not the main thread
        for number in SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, stop.handle)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
