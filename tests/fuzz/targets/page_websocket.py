"""WebSocket messages and frames to the server of the page: JSON edited before it is framed, and raw bytes."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.fuzz.base import Input, Target
from tests.fuzz.mutate import datagrams, packets
from tests.fuzz.targets._page import Page
from websockets.frames import Frame, Opcode

from monochord.core.errors import InputError

UPGRADE = (
    b"GET /live HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
ASKED = (
    b'{"do":"touch","position":0.06,"force":1.5}',
    b'{"do":"touch","position":0.07,"force":1.5,"across":-0.1}',
    b'{"do":"change","name":"noise","value":"10 dB"}',
    b'{"do":"release"}',
    b'{"do":"show","string":""}',
    b'{"do":"record","on":true}',
    b'{"do":"record","on":false}',
    b'{"do":"tune"}',
    b'{"do":"cancel"}',
    b'{"do":"calibrate","touches":3}',
    b'{"do":"hold","position":0.06,"force":1.5}',
)
FRAMES = (
    Frame(Opcode.TEXT, ASKED[0][:20], fin=False),
    Frame(Opcode.PING, b"now"),
    Frame(Opcode.CONT, ASKED[0][20:]),
    Frame(Opcode.BINARY, ASKED[1]),
    Frame(Opcode.PONG, b""),
    Frame(Opcode.TEXT, "ä".encode()),
    Frame(Opcode.TEXT, b'{"do":"change","name":"' + b"a" * 900 + b'","value":""}'),
    Frame(Opcode.CLOSE, b"\x03\xe8bye"),
)
MAX_PARTS, MAX_BYTES = 50, 10_000
"""Of a case: the server takes 4 ms for each message, and those of a flood in turn."""


def _framed(message: bytes) -> bytes:
    try:
        message.decode()
    except UnicodeDecodeError:
        return Frame(Opcode.BINARY, message).serialize(mask=True)
    return Frame(Opcode.TEXT, message).serialize(mask=True)


class Fuzz(Target):
    """A connection that is upgraded first, then sent what the input holds, and closed."""

    def __init__(self) -> None:
        self._page = cache(Page)

    def warm(self) -> None:
        self._page().check()

    def seeds(self, folder: Path) -> Iterator[Input]:
        for messages in (ASKED, ASKED[5:7], ASKED[7:], *((message,) for message in ASKED)):
            yield {"messages.packets": packets([*messages])}
        yield {"frames.packets": packets([frame.serialize(mask=True) for frame in FRAMES])}
        yield {"frames.packets": packets([_framed(each) for each in ASKED])}

    def run(self, folder: Path) -> None:
        parts = {file.name: datagrams(file.read_bytes())[:MAX_PARTS] for file in folder.iterdir()}
        if not parts:
            raise InputError("no bytes", "some")
        frames = [_framed(each) for each in parts.get("messages.packets", [])]
        raw = b"".join(parts.get("frames.packets", []))[:MAX_BYTES]
        sent = [*frames, raw, Frame(Opcode.CLOSE, b"\x03\xe8").serialize(mask=True)]
        page = self._page()
        answer = page.answer(UPGRADE, sent)
        assert answer.startswith(b"HTTP/1.1 101"), "not upgraded"
        page.check()
