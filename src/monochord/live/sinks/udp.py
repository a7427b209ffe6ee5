"""JSON datagrams: one per window, to another program on this machine or the network."""

import json
import socket
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass

from monochord.capture.address import is_port, resolved
from monochord.core.errors import InputError
from monochord.core.units import Seconds
from monochord.live.sinks._record import NANO, record, unix_nanoseconds
from monochord.live.sinks.base import NEWEST, NotDeliveredError, Run, Sink, Update, Writer

RESOLVING: Seconds = 5.0
"""Timeout for resolving the receiver's name before the first window, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Udp(Sink):
    """Send one JSON object per window as a UDP datagram of some 600 to 1400 bytes.

    Every object has ``sequence``, a datagram count from 0 that shows losses to the receiver; ``stamp``, when
    the window's last sample was at the converter (or became available, where the source does not know) in
    seconds since the Unix epoch; then the values of `jsonl`, including tracked estimates, ``events`` and
    health ``notes``. Without a receiver, datagrams are lost silently; a datagram that the system cannot send,
    as when the network is down, counts as left out.

    Parameters
    ----------
    to
        Address of the receiver, ``HOST:PORT``, or ``PORT`` on this machine. Datagrams are not encrypted.
    everything
        Whether to send all values; else only sequence, stamp, position and frequency, some 250 bytes.

    Examples
    --------
    >>> from monochord.core.types import Signal
    >>> with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
    ...     receiver.bind(("127.0.0.1", 0))
    ...     run = Run(signal=Signal(sample_rate=44100, channels=2))
    ...     with Udp(to=str(receiver.getsockname()[1])).open(run):
    ...         pass
    """

    to: str = "127.0.0.1:9880"
    everything: bool = True

    @property
    def backlog(self) -> int:
        """0.1 s of windows: a robot controller needs the newest ones."""
        return NEWEST

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:  # noqa: ARG002
        """Resolve the receiver.

        Raises `InputError` for an invalid or an IPv6 address, `DeviceError` for an unknown host.
        """
        host, _, port = self.to.rpartition(":")
        if not is_port(port):
            raise InputError(f"address '{self.to}'", "HOST:PORT, or PORT of this machine")
        address = resolved(host or "127.0.0.1", RESOLVING), int(port)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.setblocking(False)
            yield _Datagrams(sock, address, everything=self.everything)


class _Datagrams(Writer):
    def __init__(self, sock: socket.socket, address: tuple[str, int], *, everything: bool) -> None:
        # Not connected: where nobody receives, a connected socket would raise at every other datagram.
        self._socket, self._address, self._everything = sock, address, everything
        self._count = 0

    def write(self, update: Update) -> None:
        about = {"sequence": self._count, "stamp": unix_nanoseconds(update) / NANO}
        self._count += 1
        values = about | record(update, everything=self._everything)
        try:
            self._socket.sendto(json.dumps(values, allow_nan=False).encode(), self._address)
        except OSError as error:
            raise NotDeliveredError from error
