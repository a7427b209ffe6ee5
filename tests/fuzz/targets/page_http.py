"""Requests and WebSocket messages, as raw bytes to the server of the page."""

import http.client
import socket
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

from tests.fuzz.base import Input, Target
from tests.fuzz.mutate import datagrams, packets
from websockets.frames import Frame, Opcode

from monochord.capture.sources import SOURCES
from monochord.core.errors import InputError
from monochord.live.web.server import Server

REQUEST = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nCookie: monochord=none\r\nConnection: close\r\n\r\n"
UPGRADE = (
    b"GET /live HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
ASKED = (
    b'{"do":"touch","position":0.06,"force":1.5}',
    b'{"do":"change","name":"noise","value":"10 dB"}',
    b'{"do":"release"}',
)


class Fuzz(Target):
    """One server with a simulated string, which answers as before whatever came."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._server: Server | None = None

    def seeds(self, folder: Path) -> Iterator[Input]:
        yield {"bytes.packets": packets([REQUEST])}
        frames = [Frame(Opcode.TEXT, each).serialize(mask=True) for each in ASKED]
        yield {"bytes.packets": packets([UPGRADE, *frames])}

    def run(self, folder: Path) -> None:
        file = folder / "bytes.packets"
        if not file.exists():
            raise InputError("no bytes", "some")
        server = self._server or self._start()
        with suppress(OSError), socket.create_connection(("127.0.0.1", server.port), 5.0) as sock:
            for packet in datagrams(file.read_bytes())[:50]:
                sock.sendall(packet)
            sock.shutdown(socket.SHUT_WR)
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=8.0)
        connection.request("GET", "/")
        assert connection.getresponse().status == 200
        connection.close()

    def _start(self) -> Server:
        server = self._stack.enter_context(Server())
        stream = self._stack.enter_context(SOURCES.build("twin").open())
        self._stack.enter_context(server.show(stream.signal, 0.2, stream.controls))
        self._server = server
        return server
