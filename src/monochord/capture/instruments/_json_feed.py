"""An instrument whose readings arrive as JSON, one per datagram."""

import socket
from collections.abc import Callable
from typing import Generic, TypeAlias, TypeVar

import msgspec

from monochord.capture.instruments._arrivals import Arrivals
from monochord.capture.instruments._collected import NANOSECONDS, NONE, CollectedConnection
from monochord.capture.instruments._datagrams import Receiver
from monochord.core.types import Feed, Readings

LONGEST = 4096
LATEST = 9.2e9  # s, what 64 bits of nanoseconds hold


class Stamped(msgspec.Struct):
    """A datagram's optional time and count: `stamp` is the sender's clock in s, `sequence` its count."""

    stamp: float | None = None
    sequence: int | None = None


T = TypeVar("T", bound=Stamped)
Read: TypeAlias = Callable[[T], tuple[float, ...] | None]
"""Returns a datagram's values in the order of the feed's columns, or None where they are invalid."""


class JsonConnection(CollectedConnection, Generic[T]):
    """Reads datagrams of one kind from a socket; any other datagram counts as faulty."""

    def __init__(self, sock: socket.socket, feed: Feed, kind: type[T], read: Read[T]) -> None:
        super().__init__(feed)
        self._receiver, self._arrivals = Receiver(sock, LONGEST), Arrivals()
        self._decoder, self._values = msgspec.json.Decoder(kind), read

    def poll(self) -> list[Readings]:
        """Return the readings since the last poll."""
        datagrams = self._receiver.take()
        times = self._arrivals.times(datagrams.stamp)
        for payload, length, time in zip(datagrams.payload, datagrams.length, times, strict=True):
            message = self._read(payload[:length].tobytes()) if length <= LONGEST else None
            values = self._values(message) if message else None
            if message is None or values is None:
                self._collected.refuse()
                continue
            tick = NONE if message.stamp is None else round(message.stamp * NANOSECONDS)
            count = NONE if message.sequence is None else message.sequence
            self._collected.add(values, time=float(time), tick=tick, count=count)
        return self._collected.take()

    def _read(self, text: bytes) -> T | None:
        try:
            message = self._decoder.decode(text)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return None
        stamp, sequence = message.stamp, message.sequence
        fits = (stamp is None or 0.0 <= stamp < LATEST) and (sequence is None or 0 <= sequence < 1 << 62)
        return message if fits else None
