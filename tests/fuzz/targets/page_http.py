"""HTTP requests, as raw bytes to the server of the page, which asks for a token or for none."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.fuzz.base import Input, Target
from tests.fuzz.targets._page import Page

from monochord.core.errors import InputError

TOKEN = "right"  # noqa: S105  (of a server that nobody else reaches)
TOKENS = {"open": "", "guarded": TOKEN}
LET_IN = (b"HTTP/1.1 200", b"HTTP/1.1 101", b"HTTP/1.1 303")
HOST = b"Host: 127.0.0.1\r\n"
REQUESTS = (
    b"GET / HTTP/1.1\r\n" + HOST + b"Cookie: monochord=none; a=b\r\nConnection: close\r\n\r\n",
    b"GET /static/uplot/uPlot.min.css HTTP/1.1\r\n" + HOST + b"Origin: http://127.0.0.1\r\n\r\n"
    b"HEAD /static/../server.py?token=right&a=%20 HTTP/1.1\r\n" + HOST + b"\r\n",
    b"POST / HTTP/1.1\r\n" + HOST + b"Content-Length: 4\r\nExpect: 100-continue\r\n\r\nbody"
    b"GET / HTTP/1.0\r\n\r\n",
    b"PUT /live HTTP/1.1\r\n" + HOST + b"Transfer-Encoding: chunked\r\n\r\n4\r\nbody\r\n0\r\n\r\n",
    b"GET /live HTTP/1.1\r\n" + HOST + b"Upgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n\r\n",
)


class Fuzz(Target):
    """Whoever does not know the token is not let in; a server has no error of its own."""

    def __init__(self) -> None:
        self._page = cache(Page)

    def warm(self) -> None:
        for token in TOKENS.values():
            self._page(token).check()

    def seeds(self, folder: Path) -> Iterator[Input]:
        for name in TOKENS:
            for request in REQUESTS:
                yield {f"{name}.http": request}

    def run(self, folder: Path) -> None:
        names = [name for name in TOKENS if (folder / f"{name}.http").exists()]
        if not names:
            raise InputError("no request", "one")
        request, token = (folder / f"{names[0]}.http").read_bytes(), TOKENS[names[0]]
        page = self._page(token)
        answer = page.answer(request)
        assert b"HTTP/1.1 500" not in answer, "an error of the server's"
        assert token in request.decode("latin-1") or not answer.startswith(LET_IN), "let in without the token"
        page.check()
