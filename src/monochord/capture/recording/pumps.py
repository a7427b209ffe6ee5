"""Threads that read the source and the instruments, so that none waits for another or for the disk."""

import threading
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, TypeVar

from monochord.capture.instruments.base import Connection
from monochord.capture.sources.base import Stream
from monochord.core.types import Block, Readings
from monochord.core.units import Seconds

POLL_INTERVAL: Seconds = 0.01
"""Time between polls of an instrument."""
BLOCKED_WAIT: Seconds = 0.02
"""A batch that waits longer than this for space is blocked by the disk, in s."""
MAX_EARLY: Seconds = 0.05
MAX_LATE: Seconds = 0.5
"""Largest plausible deviations of a device's block time from its possible times, in s."""

T = TypeVar("T")


class BoundedQueue(Generic[T]):
    """A queue of `capacity` bytes from many threads to one writer.

    A thread waits while the queue is full; nothing is dropped. An empty queue accepts a batch of any size.

    >>> queue = BoundedQueue[str](capacity=100)
    >>> queue.put("batch", size=60), queue.take(), queue.take()
    (True, ['batch'], [])
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._items: list[T] = []
        self._size = 0
        self._closed = False
        self._changed = threading.Condition()

    @property
    def filled(self) -> float:
        """Filled share of the capacity."""
        return self._size / self._capacity

    def put(self, item: T, size: int) -> bool:
        """Add a batch of `size` bytes, waiting for space; return false if the queue was closed."""
        with self._changed:
            self._changed.wait_for(
                lambda: self._closed or not self._size or self._size + size <= self._capacity
            )
            if self._closed:
                return False
            self._items.append(item)
            self._size += size
            return True

    def take(self) -> list[T]:
        """Return and remove all batches, oldest first, without waiting."""
        with self._changed:
            items, self._items, self._size = self._items, [], 0
            self._changed.notify_all()
            return items

    def close(self) -> None:
        """Release waiting threads, and accept no more data."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentReadings:
    """Readings with the name of their instrument."""

    name: str
    readings: Readings


class Pumps:
    """The running threads; their data are in `queue`.

    `blocked` is the time in s that a live source or instrument waited for space in the queue; data that
    exceed the devices' buffers meanwhile count as lost. `failures` holds errors by instrument name, or
    ``audio`` for the source. `implausible_age` is the age in s of the latest block by the source's clock
    where that is impossible, else 0: JACK's times can be wrong by seconds after a client was killed.
    """

    def __init__(self, stream: Stream, connections: Mapping[str, Connection], capacity: int) -> None:
        self.queue = BoundedQueue[Block | InstrumentReadings](capacity)
        self.failures: dict[str, Exception] = {}
        self.blocked: Seconds = 0.0
        self.implausible_age: Seconds = 0.0
        self._stream = stream
        self._stopped = threading.Event()
        self._audio = self._thread("audio", self._read_audio)
        self._instruments = [
            self._thread(name, lambda name=name, connection=connection: self._poll(name, connection))
            for name, connection in connections.items()
        ]

    @property
    def source_ended(self) -> bool:
        """Whether the source has ended."""
        return not self._audio.is_alive()

    @property
    def ended(self) -> bool:
        """Whether all threads have ended, so that the queue contains the last data."""
        return not any(thread.is_alive() for thread in (self._audio, *self._instruments))

    def start(self) -> None:
        """Start reading."""
        for thread in (self._audio, *self._instruments):
            thread.start()

    def stop(self) -> None:
        """End the source and poll the instruments once more; returns at once."""
        self._stopped.set()
        self._stream.close()

    def _thread(self, name: str, work: Callable[[], None]) -> threading.Thread:
        def run() -> None:
            try:
                work()
            except Exception as error:  # noqa: BLE001  (reported by the loop)
                self.failures[name] = error

        return threading.Thread(target=run, name=f"record {name}", daemon=True)

    def _read_audio(self) -> None:
        for block in self._stream:
            self.implausible_age = self._implausible_age(block)
            if not self._put(block, block.samples.nbytes, live=block.adc_time is not None):
                return

    def _implausible_age(self, block: Block) -> Seconds:
        """Return a block's age by the source's clock where that is impossible, else 0."""
        if block.adc_time is None:
            return 0.0
        age = time.monotonic() - block.adc_time
        unread = (block.samples.shape[1] + self._stream.pending) / self._stream.signal.sample_rate
        return 0.0 if -MAX_EARLY <= age <= unread + MAX_LATE else age

    def _poll(self, name: str, connection: Connection) -> None:
        last = False
        while not last:
            last = self._stopped.wait(POLL_INTERVAL)
            for readings in connection.poll():
                # Sequence, time, device time and status take 28 bytes beside the values.
                size = readings.values.nbytes + 28 * len(readings.time)
                if len(readings.time) and not self._put(
                    InstrumentReadings(name=name, readings=readings), size, live=True
                ):
                    return

    def _put(self, batch: Block | InstrumentReadings, size: int, *, live: bool) -> bool:
        begin = time.monotonic()
        accepted = self.queue.put(batch, size)
        waited = time.monotonic() - begin
        if live and waited > BLOCKED_WAIT:
            self.blocked += waited
        return accepted


@contextmanager
def pumping(stream: Stream, connections: Mapping[str, Connection], capacity: int) -> Generator[Pumps]:
    """Read source and instruments until the context ends; data still in the queue are discarded."""
    pumps = Pumps(stream, connections, capacity)
    pumps.start()
    try:
        yield pumps
    finally:
        pumps.stop()
        pumps.queue.close()
        while not pumps.ended:
            time.sleep(POLL_INTERVAL)
