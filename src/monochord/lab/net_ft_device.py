"""A simulated ATI Net F/T: it uses real RDT over UDP and serves its settings over HTTP.

As a process it plays a file that `write_script` wrote. It prints its ports as one line of JSON, reads each
line of its standard input as the start, in s of the monotonic clock, and ends when that input does::

    python -m monochord.lab.net_ft_device FILE.npz
"""

import select
import socket
import struct
import sys
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from socketserver import TCPServer
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from monochord.capture.instruments import _rdt as rdt
from monochord.core.closing import Closing
from monochord.core.errors import DeviceError, InputError
from monochord.core.ranges import Checked, NonNegative, PartialShare, Positive
from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds
from monochord.lab._script import follow_input, read_script, write_script

__all__ = ["NetFtDevice", "NetFtSettings", "serve", "write_script"]

ENDLESS = -1
MAX_BURST = 70_000
"""Most records sent at once after a pause of the process; older ones count as lost."""
IDLE: Seconds = 0.02
"""Time between checks for a request while nothing is streamed, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NetFtSettings(Checked):
    """The behaviour of a simulated Net F/T.

    Parameters
    ----------
    rate
        Records per second, equal to the rate of the wrenches; at most 7000.
    counts_per_force, counts_per_torque
        Counts per newton and per newton metre.
    delay
        Time in s between a wrench and its record.
    jitter
        Mean additional delay of the network in s, exponentially distributed; records keep their order.
    loss
        Probability that the network loses a record.
    fault_after
        Time in s after the start at which a status is latched, until the latch is reset; None for never.
    fault_status
        The latched status word.
    silence
        Begin and end of a time without cable, in s after the start, in which nothing is sent or received.
    restarts
        Whether the power fails with the cable: its counters then restart, and it waits for a request.
    first_record, first_sample
        First values of its two counters.
    wake
        Interval in s at which due records are sent, which bunches their arrivals.
    seed
        Random seed of jitter and loss.
    host
        Address to bind.
    rdt_port, http_port
        Ports; 0 lets the system choose.
    """

    rate: Annotated[Hertz, Meta(gt=0.0, le=rdt.INTERNAL_RATE)] = rdt.INTERNAL_RATE
    counts_per_force: Positive[float] = 1e6
    counts_per_torque: Positive[float] = 1e6
    delay: NonNegative[Seconds] = 0.0
    jitter: NonNegative[Seconds] = 0.0
    loss: PartialShare = 0.0
    fault_after: Seconds | None = None
    fault_status: int = 0x80010000
    silence: tuple[Seconds, Seconds] | None = None
    restarts: bool = False
    first_record: int = 1
    first_sample: int = 0
    wake: Annotated[Seconds, Meta(ge=1e-5, le=0.1)] = 1e-3
    seed: int = 0
    host: str = "127.0.0.1"
    rdt_port: int = 0
    http_port: int = 0


class RecordStream:
    """The records of one device from `boot` on, in s of any clock: counters, faults, network; no sockets."""

    def __init__(self, wrenches: Floats, settings: NetFtSettings, boot: Seconds) -> None:
        per_unit = [settings.counts_per_force] * 3 + [settings.counts_per_torque] * 3
        self._counts = np.clip(np.rint(wrenches * per_unit), -(2**31), 2**31 - 1).astype(np.int64)
        self._settings = settings
        self._rng = np.random.default_rng(settings.seed)
        self._origin = boot  # sample m is taken at origin + m / rate
        self._begin = np.inf
        self._first = 1 << 62  # number of the sample at the start
        self._sample_base = 0
        self._bias = np.zeros(6, np.int64)
        self._reset = self._rebooted = False
        self._remaining = 0
        self._record = settings.first_record
        self._next = 0
        self._leaves = -np.inf
        self._in_flight: deque[tuple[Seconds, bytes]] = deque()
        self.lost = 0

    @property
    def streaming(self) -> bool:
        """Whether there are records left to send."""
        return self._remaining != 0 or bool(self._in_flight)

    def begin_at(self, begin: Seconds) -> None:
        """Set the time of the first wrench: the sampling shifts by less than one sample to match it."""
        rate = self._settings.rate
        self._first = int(np.ceil((begin - self._origin) * rate - 1e-6))
        self._begin, self._origin = begin, begin - self._first / rate

    def command(self, command: int, count: int, now: Seconds) -> None:
        """Carry out a request, if the cable is connected."""
        if self._silent(now):
            return
        self._reboot_if_due(now)
        if command == rdt.STREAM:
            self._remaining = count or ENDLESS
            self._record, self._next = self._settings.first_record, self._sample_at(now) + 1
        elif command == rdt.STOP:
            self._remaining = 0
        elif command == rdt.RESET_LATCH:
            self._reset = self._reset or self._faulty(now)
        elif command == rdt.BIAS:
            self._bias = self._load(np.array([self._sample_at(now)]))[0]

    def due(self, now: Seconds) -> list[bytes]:
        """Return the records that arrive by now, oldest first."""
        self._reboot_if_due(now)
        stop = self._sample_at(now) + 1
        if self._remaining != 0 and stop > self._next:
            if self._remaining > 0:
                stop = min(stop, self._next + self._remaining)
                self._remaining -= stop - self._next
            self._emit(np.arange(self._next, stop))
            self._next = stop
        out: list[bytes] = []
        while self._in_flight and self._in_flight[0][0] <= now:
            out.append(self._in_flight.popleft()[1])
        return out

    def _emit(self, sample: NDArray[np.int64]) -> None:
        settings, n = self._settings, sample.size
        taken = self._origin + sample / settings.rate
        records = np.zeros(n, rdt.RECORD)
        records["rdt"] = (self._record + np.arange(n)) % (1 << 32)
        ratio = rdt.INTERNAL_RATE / settings.rate
        internal = np.floor((sample - self._sample_base) * ratio).astype(np.int64)
        records["ft"] = (settings.first_sample + internal) % (1 << 32)
        records["status"] = np.where(self._faulty(taken), settings.fault_status, 0)
        records["counts"] = self._load(sample) - self._bias
        self._record += n
        leaves = taken + settings.delay
        lost = self._rng.random(n) < settings.loss if settings.loss else np.zeros(n, np.bool_)
        lost |= self._silent(leaves)
        lost[: max(0, n - MAX_BURST)] = True
        if settings.jitter:
            leaves = np.maximum.accumulate(
                np.maximum(leaves + self._rng.exponential(settings.jitter, n), self._leaves)
            )
            self._leaves = float(leaves[-1])
        self.lost += int(lost.sum())
        data, size = records.tobytes(), rdt.RECORD.itemsize
        self._in_flight.extend(
            (float(leaves[k]), data[k * size : (k + 1) * size]) for k in np.flatnonzero(~lost)
        )

    def _sample_at(self, now: Seconds) -> int:
        """Return the last sample sent by now."""
        return int(np.floor((now - self._settings.delay - self._origin) * self._settings.rate))

    def _load(self, sample: NDArray[np.int64]) -> NDArray[np.int64]:
        return self._counts[np.clip(sample - self._first, 0, len(self._counts) - 1)]

    def _faulty(self, time: Floats | Seconds) -> NDArray[np.bool_] | np.bool_ | bool:
        after = self._settings.fault_after
        return after is not None and not self._reset and np.greater_equal(time, self._begin + after)

    def _silent(self, time: Floats | Seconds) -> NDArray[np.bool_] | np.bool_ | bool:
        if self._settings.silence is None:
            return False
        start, stop = self._settings.silence
        return np.greater_equal(time, self._begin + start) & np.less(time, self._begin + stop)

    def _reboot_if_due(self, now: Seconds) -> None:
        settings = self._settings
        if not settings.restarts or settings.silence is None or self._rebooted:
            return
        if now >= self._begin + settings.silence[1]:
            self._rebooted, self._remaining = True, 0
            self._sample_base = self._sample_at(now)
            self._bias = np.zeros(6, np.int64)
            self._in_flight.clear()


class NetFtDevice(Closing):
    """A Net F/T with a known load, in a separate thread.

    Like the real device, it samples continuously, streams to one client (the last to send a request), and
    restarts the record numbers with each stream. `wrenches` (n, 6) are in N and N m, one every 1 / rate s,
    the first at `begin` in s of the monotonic clock; before that, the load is the first wrench, and after the
    end the last. 7000 records a second take about a tenth of a core: a busy program starts it as a process.
    Raises `DeviceError` where a port is taken.

    >>> import numpy as np
    >>> from monochord.capture.instruments.net_ft import NetFt
    >>> with NetFtDevice(np.array([[0.0, 0.0, 1.5, 0.0, 0.0, 0.0]])) as device:
    ...     with NetFt(address=device.address, http_port=device.http_port).open() as sensor:
    ...         float(sensor.poll()[0].values[0, 2])
    1.5
    """

    def __init__(
        self, wrenches: Floats, settings: NetFtSettings | None = None, *, begin: Seconds | None = None
    ) -> None:
        if (
            wrenches.ndim != 2
            or wrenches.shape[1] != 6
            or not len(wrenches)
            or not np.isfinite(wrenches).all()
        ):
            raise InputError(f"wrenches of shape {wrenches.shape}", "(n, 6), n above 0, all finite")
        self._settings = settings = settings or NetFtSettings()
        self._records = RecordStream(wrenches, settings, time.monotonic())
        self._lock = threading.Lock()
        if begin is not None:
            self.begin_at(begin)
        self._client: Any = None
        self._ended = threading.Event()
        self.sent = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((settings.host, settings.rdt_port))
            self._web = _Web((settings.host, settings.http_port), _page(settings))
        except OSError as error:
            self._socket.close()
            ports = f"UDP port {settings.rdt_port}, TCP port {settings.http_port}"
            raise DeviceError(f"simulated Net F/T at {settings.host}, {ports}: {error.strerror}") from error
        self._threads = [
            threading.Thread(target=self._stream, name="net-ft", daemon=True),
            threading.Thread(target=self._web.serve_forever, args=(0.05,), name="net-ft-web", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def address(self) -> str:
        """RDT address, as ``HOST:PORT``."""
        return f"{self._settings.host}:{self._socket.getsockname()[1]}"

    @property
    def http_port(self) -> int:
        """TCP port of the settings page."""
        return int(self._web.server_address[1])

    @property
    def lost(self) -> int:
        """Number of records lost by the network, or while the cable was out."""
        return self._records.lost

    def begin_at(self, begin: Seconds) -> None:
        """Set the time of the first wrench, in s of the monotonic clock."""
        with self._lock:
            self._records.begin_at(begin)

    def close(self) -> None:
        """End the threads and release the ports."""
        self._ended.set()
        self._web.shutdown()
        for thread in self._threads:
            thread.join()
        self._web.server_close()
        self._socket.close()

    def _stream(self) -> None:
        while not self._ended.is_set():
            wait = self._settings.wake if self._records.streaming else IDLE
            if select.select([self._socket], [], [], wait)[0]:
                self._receive()
            with self._lock:
                due = self._records.due(time.monotonic())
            for record in due:
                with suppress(OSError):  # the client has gone
                    self._socket.sendto(record, self._client)
            self.sent += len(due)

    def _receive(self) -> None:
        try:
            request, sender = self._socket.recvfrom(64)
            header, command, count = struct.unpack(">HHI", request)
        except (OSError, struct.error):
            return
        if header == rdt.HEADER:
            self._client = sender
            with self._lock:
                self._records.command(command, count, time.monotonic())


class _Web(TCPServer):
    allow_reuse_address = True

    def __init__(self, address: tuple[str, int], page: bytes) -> None:
        self.page = page
        super().__init__(address, _Page)


class _Page(BaseHTTPRequestHandler):
    timeout = 2.0

    def do_GET(self) -> None:  # the name that http.server calls
        page = self.server.page if isinstance(self.server, _Web) and self.path == rdt.SETTINGS else b""
        self.send_response(200 if page else 404)
        self.send_header("Content-Type", "text/xml")
        self.send_header("Content-Length", str(len(page)))
        self.end_headers()
        self.wfile.write(page)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Log nothing."""


def _page(settings: NetFtSettings) -> bytes:
    words = {
        "prodname": "Net F/T, simulated",
        "setserial": "0",
        "cfgnam": "simulated",
        "cfgcpf": f"{settings.counts_per_force:.15g}",
        "cfgcpt": f"{settings.counts_per_torque:.15g}",
        "scfgfu": "N",
        "scfgtu": "Nm",
        "comrdte": "Enabled",
        "comrdtrate": f"{settings.rate:g}",
        "runrate": f"{rdt.INTERNAL_RATE:g}",
    }
    inside = "".join(f"<{name}>{word}</{name}>\n" for name, word in words.items())
    return f'<?xml version="1.0"?>\n<netft>\n{inside}</netft>\n'.encode()


def serve(path: Path) -> None:
    """Play the script at `path`, its array ``wrenches``, until the standard input ends."""
    arrays, settings = read_script(path, NetFtSettings)
    with NetFtDevice(arrays["wrenches"], settings) as device:
        follow_input({"address": device.address, "http_port": device.http_port}, device.begin_at)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
