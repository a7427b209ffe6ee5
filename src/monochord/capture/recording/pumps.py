"""Threads that read source and instruments, so that none waits for another or for the disk."""

import threading
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from monochord.capture.instruments.base import Connection
from monochord.capture.recording.inbox import Inbox
from monochord.capture.sources.base import Stream
from monochord.core.types import Block, Readings
from monochord.core.units import Seconds

POLL: Seconds = 0.01
"""From one look at an instrument to the next."""
SLOW: Seconds = 0.02
"""A batch that waited longer for room than this was held up by the disk."""
EARLY: Seconds = 0.05
LATE: Seconds = 0.5
"""How far a device's times of its frames may be from when they can have been at the converter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Polled:
    """Readings with the name of the instrument that they came from."""

    name: str
    readings: Readings


class Pumps:
    """The running threads: what they bring is in `inbox`.

    `held_up` is for how long so far a live source or instrument waited for room in the inbox, in s; what the
    devices' own buffers could not hold meanwhile, they count as lost. `failures` are errors by the name of
    whatever raised them, ``audio`` for the source. `doubt` is for how long ago the source says that its
    newest block began, in s, where that cannot be, and else 0: JACK's times can be wrong by seconds after a
    client was killed.
    """

    def __init__(self, stream: Stream, connections: Mapping[str, Connection], room: int) -> None:
        self.inbox = Inbox[Block | Polled](room)
        self.failures: dict[str, Exception] = {}
        self.held_up: Seconds = 0.0
        self.doubt: Seconds = 0.0
        self._stream = stream
        self._stopped = threading.Event()
        self._audio = self._thread("audio", self._read_audio)
        self._others = [
            self._thread(name, lambda name=name, open_=connection: self._poll(name, open_))
            for name, connection in connections.items()
        ]

    @property
    def source_ended(self) -> bool:
        """Whether the source has no more."""
        return not self._audio.is_alive()

    @property
    def ended(self) -> bool:
        """Whether all that will ever come is in the inbox."""
        return not any(thread.is_alive() for thread in (self._audio, *self._others))

    def start(self) -> None:
        """Begin to read."""
        for thread in (self._audio, *self._others):
            thread.start()

    def stop(self) -> None:
        """End the source and poll the instruments once more; returns at once."""
        self._stopped.set()
        self._stream.close()

    def _thread(self, name: str, work: Callable[[], None]) -> threading.Thread:
        def run() -> None:
            try:
                work()
            except Exception as error:  # noqa: BLE001  (told by the loop, in whose thread it counts)
                self.failures[name] = error

        return threading.Thread(target=run, name=f"record {name}", daemon=True)

    def _read_audio(self) -> None:
        for block in self._stream:
            self.doubt = self._doubt(block)
            if not self._put(block, block.samples.nbytes, live=block.adc_time is not None):
                return

    def _doubt(self, block: Block) -> Seconds:
        """Return how long ago a block began, by its own time, where that cannot be."""
        if block.adc_time is None:
            return 0.0
        ago = time.monotonic() - block.adc_time
        unread = (block.samples.shape[1] + self._stream.pending) / self._stream.signal.sample_rate
        return ago if not -EARLY <= ago <= unread + LATE else 0.0

    def _poll(self, name: str, connection: Connection) -> None:
        last = False
        while not last:
            last = self._stopped.wait(POLL)
            for readings in connection.poll():
                # Sequence, time, device time and status take 28 bytes beside the values.
                size = readings.values.nbytes + 28 * len(readings.time)
                if len(readings.time) and not self._put(
                    Polled(name=name, readings=readings), size, live=True
                ):
                    return

    def _put(self, batch: Block | Polled, size: int, *, live: bool) -> bool:
        begin = time.monotonic()
        taken = self.inbox.put(batch, size)
        waited = time.monotonic() - begin
        if live and waited > SLOW:
            self.held_up += waited
        return taken


@contextmanager
def pumping(stream: Stream, connections: Mapping[str, Connection], room: int) -> Generator[Pumps]:
    """Read source and instruments until the context is left; what is then in the inbox is given up."""
    pumps = Pumps(stream, connections, room)
    pumps.start()
    try:
        yield pumps
    finally:
        pumps.stop()
        pumps.inbox.close()
        while not pumps.ended:
            time.sleep(POLL)
