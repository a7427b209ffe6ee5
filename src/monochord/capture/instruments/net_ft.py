"""An ATI Net F/T force/torque sensor over its network protocol, RDT."""

import socket
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from monochord.capture.address import is_port, resolved
from monochord.capture.instruments import _rdt as rdt
from monochord.capture.instruments._arrivals import Arrivals
from monochord.capture.instruments._datagrams import Receiver, wait_readable
from monochord.capture.instruments._sequence import Sequence
from monochord.capture.instruments.base import Connection, Instrument
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import WRENCH, Feed, InstrumentHealth, Readings
from monochord.core.units import Hertz, Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class NetFt(Instrument):
    """A Net F/T box at `address`, which streams force and torque over UDP.

    The scale comes from the device's settings, which must state their units, by code or by word. Readings
    have the kernel's time of arrival. Their `sequence` is the device's record count, continued across
    restarts; `device_time` is its count of internal samples and `status` its status word. A silent device is
    asked to stream again until it answers. Between polls the kernel buffers the records: one second needs
    about 6 MB, which ``net.core.rmem_max`` may not allow.

    Parameters
    ----------
    address
        Host name or IP address; ``HOST:PORT`` for a UDP port of the RDT stream other than 49152.
    http_port
        TCP port of its web pages, which state the counts per newton.
    rate
        Configured records per second; 0 to use its settings.
    bias
        Whether to zero the present load.
    reset_latch
        Whether to clear latched threshold conditions.
    timeout_seconds
        Timeout for opening, in seconds: name resolution, settings, first record.
    silence_seconds
        Silence in seconds after which it is asked to stream again.
    """

    address: str = "127.0.0.1"
    http_port: Annotated[int, Meta(ge=1, le=65535)] = 80
    rate: Annotated[Hertz, Meta(ge=0.0, le=100e3)] = 0.0
    bias: bool = False
    reset_latch: bool = False
    timeout_seconds: Annotated[Seconds, Meta(ge=0.01, le=60.0)] = 2.0
    silence_seconds: Annotated[Seconds, Meta(ge=0.01, le=60.0)] = 0.2

    @contextmanager
    def open(self) -> Generator["_NetFtConnection"]:
        """Read the settings and start the stream; raises `DeviceError` if the device does not answer."""
        host, port = self._place()
        deadline = time.monotonic() + self.timeout_seconds
        place = resolved(host, self.timeout_seconds)
        calibration = rdt.fetch_calibration(host, place, self.http_port, deadline)
        if self.rate:
            calibration = replace(calibration, rate=self.rate)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            try:
                # From here on the kernel keeps every other sender's datagrams away.
                sock.connect((place, port))
            except OSError as error:
                raise DeviceError(f"Net F/T at {self.address}: {error.strerror or error}") from error
            connection = _NetFtConnection(self, sock, calibration)
            try:
                connection.start(deadline)
                yield connection
            finally:
                connection.stop()

    def _place(self) -> tuple[str, int]:
        host, colon, text = self.address.partition(":")
        port = text if colon else str(rdt.RDT_PORT)
        if not host:
            raise InputError(f"address '{self.address}'", "HOST or HOST:PORT")
        if not is_port(port):
            raise InputError(f"RDT port {port}", "1 to 65535")
        return host, int(port)


class _NetFtConnection(Connection):
    def __init__(self, options: NetFt, sock: socket.socket, calibration: rdt.CountScale) -> None:
        self._options, self._socket, self._scale = options, sock, calibration.scale
        self._receiver = Receiver(sock, rdt.RECORD.itemsize)
        self._arrivals = Arrivals()
        self._sequence = Sequence(
            wraps=True,
            ticks=calibration.internal_rate / calibration.rate,
            rate=calibration.rate,
            patience=calibration.internal_rate,
        )
        self._health = InstrumentHealth()
        self._request_time = self._arrival_time = time.monotonic()
        self._away = False
        self._tick = 0
        self._feed = Feed(
            stream="wrench",
            columns=WRENCH,
            units=("N",) * 3 + ("N m",) * 3,
            rate=calibration.rate,
            ticks=calibration.internal_rate,
            details=MappingProxyType(
                {
                    **calibration.details,
                    "address": options.address,
                    "receive_buffer": f"{self._receiver.buffer} bytes",
                }
            ),
        )

    @property
    def feed(self) -> Feed:
        return self._feed

    @property
    def health(self) -> InstrumentHealth:
        return replace(self._health, missing=self._sequence.missing, out_of_order=self._sequence.late)

    def start(self, deadline: Seconds) -> None:
        for wanted, command in (
            (True, rdt.STOP),
            (self._options.reset_latch, rdt.RESET_LATCH),
            (self._options.bias, rdt.BIAS),
            (True, rdt.STREAM),
        ):
            if wanted:
                self._send(command)
        if not wait_readable(self._socket, max(deadline - time.monotonic(), 0.0)):
            raise DeviceError(
                f"Net F/T at {self._options.address}: no record within {self._options.timeout_seconds} s; "
                "is RDT enabled on its communication page, and is UDP allowed through the firewall?"
            )

    def stop(self) -> None:
        self._send(rdt.STOP)

    def poll(self) -> list[Readings]:
        datagrams = self._receiver.take()
        times = self._arrivals.times(datagrams.stamp)
        right = datagrams.length == rdt.RECORD.itemsize
        now = time.monotonic()
        faulty = int(np.count_nonzero(~right))
        if faulty:
            self._health = replace(self._health, faulty=self._health.faulty + faulty)
        if not right.any():
            self._ask_again(now)
            return []
        record = np.ascontiguousarray(datagrams.payload[right, : rdt.RECORD.itemsize]).view(rdt.RECORD)[:, 0]
        times, tick = times[right], record["ft"].astype(np.int64)
        numbers, in_order = self._sequence.follow(
            record["rdt"].astype(np.int64), tick, times, away=self._away
        )
        self._arrival_time = now
        status = record["status"][in_order].astype(np.uint32)
        self._health = replace(
            self._health,
            readings=self._health.readings + status.size,
            faulty=self._health.faulty + int(np.count_nonzero(status)),
            reconnects=self._health.reconnects + self._away,
        )
        self._away = False
        if not status.size:
            return []
        return [
            Readings(
                stream="wrench",
                time=times[in_order],
                values=record["counts"][in_order] * self._scale,
                sequence=numbers[in_order],
                device_time=self._unwrapped(tick[in_order]),
                status=status,
            )
        ]

    def _unwrapped(self, tick: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the count of internal samples, (n,), continued across wrap-around."""
        before = self._tick if self._health.readings > tick.size else int(tick[0])
        ticks = before + np.cumsum((np.diff(tick, prepend=before) + (1 << 31)) % (1 << 32) - (1 << 31))
        self._tick = int(ticks[-1])
        return ticks

    def _ask_again(self, now: Seconds) -> None:
        silence = self._options.silence_seconds
        if now - max(self._arrival_time, self._request_time) > silence:
            self._request_time, self._away = now, True
            self._send(rdt.STREAM)

    def _send(self, command: int) -> None:
        # A network or a device that is down is what polling again is for.
        with suppress(OSError):
            self._socket.send(rdt.request(command))
