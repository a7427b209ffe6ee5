"""Who may see the page: the addresses by which it is called, a token, and what a browser may do with it.

A page of anybody's may make a browser send requests to this machine. Three things keep it out: the name by
which the server is called must be this machine's (a name of somebody else's that resolves to 127.0.0.1 is
DNS rebinding), the page that opens a WebSocket must be our own, and beyond this machine a token is needed.
"""

import hmac
import ipaddress
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Any, TypeAlias
from urllib.parse import parse_qs, urlsplit

Scope: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send: TypeAlias = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App: TypeAlias = Callable[[Scope, Receive, Send], Awaitable[None]]

COOKIE = "monochord"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = [
    (b"content-security-policy", POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
]


def is_loopback(host: str) -> bool:
    """Return whether a host is reached from this machine alone.

    >>> is_loopback("127.0.0.1"), is_loopback("localhost"), is_loopback("0.0.0.0")
    (True, True, False)
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@dataclass(frozen=True, slots=True, kw_only=True)
class Guard:
    """What is let through to the page: see the module.

    `host` is the address that is listened at, and `token` what a caller must know, nothing where it is empty.
    A link with ``?token=...`` is answered with a cookie and without the token in the address.
    """

    host: str
    token: str = ""

    def known_host(self, header: str) -> bool:
        """Return whether a Host header names this machine; any port, as a tunnel may end at another.

        >>> guard = Guard(host="127.0.0.1")
        >>> guard.known_host("localhost:9000"), guard.known_host("evil.org")
        (True, False)
        """
        name = _name(header)
        if name is None:
            return False
        if is_loopback(name) or name == self.host:
            return True
        if is_loopback(self.host):
            return False
        own = socket.gethostname().lower()
        return _is_address(name) or name in (own, own.partition(".")[0], f"{own.partition('.')[0]}.local")

    def same_origin(self, origin: str | None, host: str) -> bool:
        """Return whether a request comes from a page of this server; programs but browsers say nothing.

        >>> Guard(host="127.0.0.1").same_origin("http://localhost:1", "localhost:1")
        True
        >>> Guard(host="127.0.0.1").same_origin("http://localhost:2", "localhost:1")
        False
        """
        return origin is None or origin.lower() in (f"http://{host}".lower(), f"https://{host}".lower())

    def knows_token(self, text: str) -> bool:
        """Return whether a text is the token, in a time that does not depend on where it differs."""
        return not self.token or hmac.compare_digest(text.encode(), self.token.encode())

    def around(self, app: App) -> App:
        """Return an application that answers what is let through by `app`, and else refuses."""

        async def guarded(scope: Scope, receive: Receive, send: Send) -> None:
            if scope["type"] not in ("http", "websocket"):
                await app(scope, receive, send)
                return
            headers = {name.lower(): value.decode("latin-1") for name, value in scope["headers"]}
            host = headers.get(b"host", "")
            given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
            right = self.knows_token(_cookie(headers.get(b"cookie", "")))
            if not self.known_host(host):
                await _refuse(scope, send, 421, "This server is called by another name.")
            elif not self.same_origin(headers.get(b"origin"), host):
                await _refuse(scope, send, 403, "The page of another server may not use this one.")
            elif self.token and given and self.knows_token(given) and scope["type"] == "http":
                await _answer(send, 303, b"", [(b"location", b"/"), (b"set-cookie", self._cookie())])
            elif not right:
                await _refuse(scope, send, 401, "Open the address with its token, as it was printed.")
            else:
                await app(scope, receive, _with_headers(send))

        return guarded

    def _cookie(self) -> bytes:
        return f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/".encode("latin-1")


def _name(header: str) -> str | None:
    try:
        return urlsplit(f"//{header}").hostname
    except ValueError:
        return None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _cookie(header: str) -> str:
    try:
        morsel = SimpleCookie(header).get(COOKIE)
    except CookieError:
        return ""
    return "" if morsel is None else morsel.value


def _with_headers(send: Send) -> Send:
    async def sending(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", []), *HEADERS]}
        await send(message)

    return sending


async def _refuse(scope: Scope, send: Send, status: int, sentence: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": sentence})
        return
    await _answer(send, status, f"{sentence}\n".encode(), [(b"content-type", b"text/plain; charset=utf-8")])


async def _answer(send: Send, status: int, body: bytes, headers: list[tuple[bytes, bytes]]) -> None:
    length = (b"content-length", str(len(body)).encode())
    start = {"type": "http.response.start", "status": status, "headers": [*headers, length]}
    await _with_headers(send)(start)
    await send({"type": "http.response.body", "body": body})
