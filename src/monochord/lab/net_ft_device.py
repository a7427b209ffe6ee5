"""A simulated ATI Net F/T: it speaks real RDT over UDP and serves its settings over HTTP.

As a process of its own it plays a file that `write_script` wrote. It says on one line of JSON which ports
it took, takes each line of its standard input as the begin, in s of the monotonic clock, and ends when that
does::

    python -m monochord.lab.net_ft_device FILE.npz
"""

import select
import socket
import struct
import sys
import threading
import time
from contextlib import suppress
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from socketserver import TCPServer
from types import TracebackType
from typing import Any, Self

import numpy as np

from monochord.capture.instruments import _rdt as rdt
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.lab._rdt_records import NetFtSettings, RecordStream
from monochord.lab._script import obey, read_script, write_script

__all__ = ["NetFtDevice", "NetFtSettings", "serve", "write_script"]

IDLE = 0.02


class NetFtDevice:
    """A Net F/T whose load is known, in a thread of its own.

    Like the real one it samples all the time, streams to one client, the one that asked last, and numbers the
    records of each stream anew. Before its begin it feels the first wrench and after its end the last. 7000
    records a second take about a tenth of a core: a program that is busy otherwise starts it as a process.

    Parameters
    ----------
    wrenches
        Force in N and torque in N m, (n, 6), one each 1 / rate s.
    settings
        How it behaves.
    begin
        When the first wrench is felt, in s of the monotonic clock; may be told later.

    Raises
    ------
    InputError
        If the wrenches are not (n, 6) and finite.
    DeviceError
        If a port is taken.

    Examples
    --------
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
        """Where it listens, as ``HOST:PORT``."""
        return f"{self._settings.host}:{self._socket.getsockname()[1]}"

    @property
    def http_port(self) -> int:
        """Where its settings are served."""
        return int(self._web.server_address[1])

    @property
    def lost(self) -> int:
        """Records so far that were lost on the way, or while the cable was out."""
        return self._records.lost

    def begin_at(self, begin: Seconds) -> None:
        """Say when the first wrench is felt, in s of the monotonic clock."""
        with self._lock:
            self._records.begin_at(begin)

    def close(self) -> None:
        """End its threads and give its ports back."""
        self._ended.set()
        self._web.shutdown()
        for thread in self._threads:
            thread.join()
        self._web.server_close()
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _stream(self) -> None:
        while not self._ended.is_set():
            wait = self._settings.wake if self._records.streaming else IDLE
            if select.select([self._socket], [], [], wait)[0]:
                self._listen()
            with self._lock:
                due = self._records.due(time.monotonic())
            for record in due:
                with suppress(OSError):  # a client that has gone
                    self._socket.sendto(record, self._client)
            self.sent += len(due)

    def _listen(self) -> None:
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
        """Say nothing."""


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
        obey({"address": device.address, "http_port": device.http_port}, device.begin_at)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
