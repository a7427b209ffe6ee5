"""JSON datagrams: one a window, to another program here or on the network."""

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
"""How long the receiver's name may take to be found, before the first window."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Udp(Sink):
    """Send one JSON object a window as a UDP datagram of some 600 to 1400 bytes.

    Every object has ``sequence``, which counts datagrams from 0 so that a receiver notices what was lost;
    ``stamp``, when the window's last sample was at the converter (at hand, where the source does not know) in
    seconds since the Unix epoch; then what `jsonl` writes, the estimates followed over time, ``events`` and
    ``notes`` on the sensor's health among it. Nobody need receive it: a datagram that nobody takes is gone,
    and one that the system does not send, as with a network that is down, is counted as left out.

    Parameters
    ----------
    to
        Address of the receiver, ``HOST:PORT``, or ``PORT`` on this machine. Datagrams are not encrypted.
    everything
        Whether to send all of that; else count, stamp, position and frequency alone, some 250 bytes.

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
        """0.1 s of windows: who controls a robot wants the newest, and not all."""
        return NEWEST

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:  # noqa: ARG002
        """Find the receiver; raises `InputError` for no address, `DeviceError` for an unknown host."""
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
