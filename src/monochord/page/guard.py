"""Access control of the page: host names, a token, and browser restrictions.

A foreign web page can make a browser send requests to this machine. Three checks block it: the host name in a
request must be this machine's (a foreign name that resolves to 127.0.0.1 is DNS rebinding); a WebSocket must
be opened by this server's page; and from other machines a token is required.
"""

import asyncio
import hmac
import ipaddress
import re
import secrets
import socket
import sys
import time
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias
from urllib.parse import quote, unquote, urlsplit

from monochord.core.errors import InputError
from monochord.core.units import Seconds

Scope: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send: TypeAlias = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App: TypeAlias = Callable[[Scope, Receive, Send], Awaitable[None]]
Headers: TypeAlias = list[tuple[bytes, bytes]]

COOKIE = "monochord"
"""Cookie name for programs; a browser's cookie name ends with the port."""
FREE = 10
"""Number of wrong tokens from an address without a delay."""
INTERVAL: Seconds = 0.1
"""Delay between wrong tokens from an address after that many, in s."""
MAX_ATTEMPTS = 64
"""Most requests with a wrong token that wait for their answer."""
MAX_SOURCES = 1024
"""Most addresses remembered; more are forgotten after their delay."""
NAME = re.compile(r"[a-z0-9][a-z0-9_-]*(\.[a-z0-9][a-z0-9_-]*)*")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS: Headers = [
    (b"content-security-policy", POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
]


def is_loopback(host: str) -> bool:
    """Return whether a host address is reachable from this machine only.

    >>> is_loopback("127.0.0.1"), is_loopback("localhost"), is_loopback("0.0.0.0")
    (True, True, False)
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def page_name(text: str) -> str:
    """Return a host name of the page, NAME or NAME:PORT, as a browser writes it; `InputError` if it is none.

    >>> page_name("Lab.Example.org."), page_name("lab:8443"), page_name("lab:443")
    ('lab.example.org', 'lab:8443', 'lab')
    """
    name, port = "", None
    try:
        parts = urlsplit(f"//[{text}]" if _is_address(text) and ":" in text else f"//{text}")
        if parts.netloc in (text, f"[{text}]") and "@" not in text:
            name, port = (parts.hostname or "").rstrip("."), parts.port
            name = f"[{name}]" if ":" in name else name.encode("idna").decode()
    except ValueError:
        pass  # the name is empty
    if not (NAME.fullmatch(name) or _is_address(name.strip("[]"))):
        remedy = "write --allow-host lab.example.org"
        raise InputError(f"name '{text}' of the page", "NAME or NAME:PORT", remedy)
    return name if port in (None, 80, 443) else f"{name}:{port}"


@dataclass(slots=True)
class _Sender:
    """An address's attempts: when its delay ends, and its waiting requests."""

    due: Seconds = 0.0
    turn: asyncio.Lock = field(default_factory=asyncio.Lock)

    @property
    def pause(self) -> Seconds:
        return max(0.0, self.due - FREE * INTERVAL - time.monotonic())


class TokenAttempts:
    """Checks tokens, and slows down an address that tries many.

    The right token is let in at once, whatever else comes from its address: people behind one router share
    it. The first `FREE` wrong tokens from an address have no delay; after that one is answered every
    `INTERVAL`, in order. Other addresses are not delayed.
    """

    def __init__(self, is_right: Callable[[str], bool]) -> None:
        self._is_right = is_right
        self._senders: dict[str, _Sender] = {}
        self._waiting = 0

    async def right(self, address: str, text: str, gone: Callable[[], bool] = lambda: False) -> bool | None:
        """Return whether a text is the token; None where it is wrong and too many wait.

        A sender that is `gone` does not delay the others.

        >>> asyncio.run(TokenAttempts("mine".__eq__).right("192.168.1.5", "yours"))
        False
        """
        if self._is_right(text):
            return True
        sender = self._sender(_network(address))
        if self._waiting >= MAX_ATTEMPTS and (sender.turn.locked() or sender.pause):
            return None
        self._waiting += 1
        try:
            async with sender.turn:
                await asyncio.sleep(sender.pause)
                if not gone():
                    sender.due = max(sender.due, time.monotonic()) + INTERVAL
                return False
        finally:
            self._waiting -= 1

    def _sender(self, name: str) -> _Sender:
        if len(self._senders) >= MAX_SOURCES:
            now, senders = time.monotonic(), self._senders
            self._senders = {
                name: each for name, each in senders.items() if each.due > now or each.turn.locked()
            }
        return self._senders.setdefault(name, _Sender())


@dataclass(frozen=True, slots=True, kw_only=True)
class Guard:
    """Decides which requests may reach the page; see the module.

    `host` and `port` are the listening address, `names` further host names as `page_name` returns them, and
    `token` is the required token, empty for none. The server answers a link with ``?token=...`` by setting a
    cookie and redirecting to the address without the token. The cookie also holds an unguessable `key`, so
    that an admitted browser never waits behind others' token attempts.
    """

    host: str
    port: int = 0
    token: str = ""
    names: tuple[str, ...] = ()
    key: str = field(default_factory=secrets.token_urlsafe)

    def names_this_machine(self, header: str) -> bool:
        """Return whether a Host header names this machine; any port, since a tunnel may end at another one.

        >>> guard = Guard(host="127.0.0.1", names=("lab.example.org",))
        >>> [guard.names_this_machine(header) for header in ("localhost:9000", "lab.example.org", "evil.org")]
        [True, True, False]
        """
        name = _name(header)
        if name is None:
            return False
        if is_loopback(name) or name == self.host or name in map(_name, self.names):
            return True
        if is_loopback(self.host):
            return False
        machine = socket.gethostname().lower()
        short = machine.partition(".")[0]
        return _is_address(name) or name in (machine, short, f"{short}.local")

    def same_origin(self, origin: str | None, host: str) -> bool:
        """Return whether a request comes from this server's page.

        Programs other than browsers send no origin.

        >>> Guard(host="127.0.0.1").same_origin("http://localhost:1", "localhost:1")
        True
        >>> Guard(host="127.0.0.1").same_origin("http://localhost:2", "localhost:1")
        False
        """
        origins = {
            f"{scheme}://{name}".lower() for scheme in ("http", "https") for name in (host, *self.names)
        }
        return origin is None or origin.lower() in origins

    def knows_token(self, text: str) -> bool:
        """Return whether a text is the token, in constant time."""
        return not self.token or hmac.compare_digest(text.encode(), self.token.encode())

    def around(self, app: App) -> App:
        """Return an application that passes admitted requests to `app` and refuses others."""
        from starlette.requests import HTTPConnection  # noqa: PLC0415  (loads a web server)

        attempts, is_told = TokenAttempts(self.knows_token), False

        async def guarded(scope: Scope, receive: Receive, send: Send) -> None:
            """Pass a request on, or refuse it."""
            nonlocal is_told
            request = HTTPConnection(scope)
            if refusal := self._refusal(request.headers):
                status, sentence = refusal
                if status == 403 and not is_told:  # a browser keeps to itself why a WebSocket is refused
                    is_told = True
                    sys.stderr.write(f"page: {sentence}\n")
                await _refuse(scope, send, status, sentence)
                return
            link = request.query_params.get("token", "") if scope["type"] == "http" else ""
            name = self._cookie_name(request.headers.get("host", ""))
            text, _, key = (request.cookies.get(name) or request.cookies.get(COOKIE, "")).partition(":")
            is_known = not self.token or hmac.compare_digest(key.encode(), self.key.encode())
            right: bool | None = is_known
            if not is_known and (given := link or unquote(text)):
                address = (scope["client"] or [""])[0]
                right = await attempts.right(address, given, lambda: scope["state"]["connection"].gone)
            if not right:
                await _refuse(scope, send, *(WAIT if right is None else UNKNOWN))
                return
            scope["state"]["connection"].is_let_in = True
            # Without a path it is for this page's folder, whatever that is called before a proxy.
            cookie = f"{name}={quote(self.token, safe='')}:{self.key}; HttpOnly; SameSite=Strict".encode()
            if self.token and link and scope["path"] == "/":
                await _answer(send, 303, b"", [(b"location", b"./"), (b"set-cookie", cookie)])
            elif is_known or scope["path"] not in ("/", "/live"):
                await app(scope, receive, _with_headers(send, HEADERS))
            else:
                await app(scope, receive, _with_headers(send, [*HEADERS, (b"set-cookie", cookie)]))

        return guarded

    def _refusal(self, headers: Mapping[str, str]) -> tuple[int, str] | None:
        """Return status and reason where a request's host or origin is refused, None where accepted."""
        host, origin = headers.get("host", ""), headers.get("origin")
        for name in (host, headers.get("x-forwarded-host", host).partition(",")[0].strip()):
            if not self.names_this_machine(name):
                return 421, f"This server is called by another name. {_advice(_name(name) or '')}"
        if not self.same_origin(origin, host):
            name = (origin or "").partition("://")[2]
            return 403, f"The page of another server may not use this one. {_advice(name)}"
        return None

    def _cookie_name(self, host: str) -> str:
        """Return the cookie's name: cookies of a host are shared by all its ports, each with its own page."""
        try:
            port = urlsplit(f"//{host}").port
        except ValueError:
            port = None
        return f"{COOKIE}_{port or self.port}"


UNKNOWN = (401, "Open the address with its token, as it was printed.")
WAIT = (429, "Too many wrong tokens came from your address. Try again in some seconds.")


def _advice(name: str) -> str:
    try:
        return f"If it is yours, start Monochord with --allow-host {page_name(name)}."
    except InputError:
        return "If it is yours, start Monochord with --allow-host NAME."


def _name(header: str) -> str | None:
    try:
        return (urlsplit(f"//{header}").hostname or "").rstrip(".")
    except ValueError:
        return None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _network(address: str) -> str:
    """Return the address that tries tokens.

    For IPv6 the network, since one machine can have any address in it.
    """
    try:
        ip = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(ip, ipaddress.IPv6Address) and not ip.ipv4_mapped:
        return str(ipaddress.ip_network((ip, 64), strict=False))
    return str(ip)


def _with_headers(send: Send, more: Headers) -> Send:
    async def sending(message: MutableMapping[str, Any]) -> None:
        if message["type"] in ("http.response.start", "websocket.accept"):
            present = message.get("headers", [])
            names = {name for name, _ in present}  # a report has its own policy
            message = {**message, "headers": [*present, *(each for each in more if each[0] not in names)]}
        await send(message)

    return sending


async def _refuse(scope: Scope, send: Send, status: int, sentence: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": sentence})
        return
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"connection", b"close")]
    await _answer(send, status, f"{sentence}\n".encode(), headers)


async def _answer(send: Send, status: int, body: bytes, headers: Headers) -> None:
    length = (b"content-length", str(len(body)).encode())
    start = {"type": "http.response.start", "status": status, "headers": [*headers, length]}
    await _with_headers(send, HEADERS)(start)
    await send({"type": "http.response.body", "body": body})
