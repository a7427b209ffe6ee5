"""The page's connections: idle ones are limited in number and time, and block no one.

A connection waits for a request from when it is accepted, and again after each answer. One that waits too
long is closed, however slowly it sends; where too many wait, a new connection replaces the longest waiting
one. A browser sends its request at once, and so gets its answer however many connect. The WebSocket of an
open page does not count: it is one long request.
"""

import asyncio
import resource
import socket
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeAlias

from monochord.core.units import Seconds
from monochord.page.guard import App, Receive, Scope, Send

MAX_WAITING = 64
"""Most connections waiting for their request."""
DEADLINE: Seconds = 10.0
"""Time for a connection to complete its request, in s."""
MIN_AGE: Seconds = 0.1
"""Shortest time a connection keeps its place, in s, which bounds the work that a flood causes."""
ANSWER: Seconds = 30.0
"""Time for an answer to be read, in s; not for a WebSocket."""
REFUSAL: Seconds = 0.004
"""Pause in accepting connections after each refused request, in s, so that refusals cost a bounded share."""
RETRY: Seconds = 0.2
"""Pause where the system refuses new connections, in s."""

Protocol: TypeAlias = Callable[[dict[str, Any]], asyncio.BaseProtocol]


def share_of_descriptors(part: int, limit: int) -> int:
    """Return 1/`part` of the file descriptors that this process may open, at most `limit`.

    >>> share_of_descriptors(1, 2)
    2
    """
    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return limit if allowed == resource.RLIM_INFINITY else max(1, min(limit, allowed // part))


@dataclass(eq=False, slots=True)
class Connection:
    """A connection, available to an application in its scope's state.

    The application sets `is_let_in` once it accepts the request.
    """

    transport: asyncio.Transport | None = None
    is_let_in: bool = False
    since: Seconds = 0.0
    deadline: asyncio.TimerHandle | None = None

    @property
    def gone(self) -> bool:
        """Whether either side has closed the connection."""
        return self.transport is not None and self.transport.is_closing()

    @property
    def done(self) -> bool:
        """Whether the connection is closed with nothing left to send."""
        return self.gone and not self.sends

    @property
    def sends(self) -> bool:
        """Whether part of an answer is still unsent."""
        return self.transport is not None and self.transport.get_write_buffer_size() > 0


@dataclass(eq=False)
class Connections:
    """Accepts connections from a listening socket and passes them to protocols; see the module.

    `protocol` creates a connection's protocol from the state of its scopes.
    """

    listening: socket.socket
    protocol: Protocol
    closed: int = field(default=0, init=False)
    """Number of connections closed because their request did not arrive in time."""
    errors: int = field(default=0, init=False)
    """Number of times the system refused a new connection."""

    def __post_init__(self) -> None:
        self._waiting: dict[Connection, None] = {}  # the one that waits longest first
        self._resume: Seconds = 0.0
        self._max_waiting = share_of_descriptors(16, MAX_WAITING)

    async def take(self) -> None:
        """Accept connections until cancelled."""
        loop = asyncio.get_running_loop()
        self.listening.setblocking(False)
        while True:
            await asyncio.sleep(self._resume - loop.time())
            try:
                sock, _ = await loop.sock_accept(self.listening)
            except OSError as error:
                self._refused(error)
                await asyncio.sleep(RETRY)
                continue
            await self._make_room()
            connection = Connection()
            self._wait(connection)
            make = partial(self.protocol, {"connection": connection})
            try:
                connection.transport, _ = await loop.connect_accepted_socket(make, sock)
            except OSError:  # it went away
                sock.close()
                self._forget(connection)

    def around(self, app: App) -> App:
        """Return `app` wrapped so that its connection does not count as waiting during a request."""

        async def served(scope: Scope, receive: Receive, send: Send) -> None:
            """Answer a request."""
            connection: Connection = scope["state"]["connection"]
            self._forget(connection)
            connection.is_let_in = False
            if scope["type"] == "http":  # else it lasts as long as the page is open
                self._close_later(connection, ANSWER)
            try:
                await app(scope, receive, send)
            finally:
                self._wait(connection)
                if not connection.is_let_in:
                    self._resume = max(self._resume, connection.since) + REFUSAL

        return served

    def _wait(self, connection: Connection) -> None:
        self._forget(connection)
        connection.since = asyncio.get_running_loop().time()
        self._close_later(connection, DEADLINE)
        self._waiting[connection] = None

    def _forget(self, connection: Connection) -> None:
        self._waiting.pop(connection, None)
        if connection.deadline:
            connection.deadline.cancel()

    def _close_later(self, connection: Connection, seconds: Seconds) -> None:
        connection.deadline = asyncio.get_running_loop().call_later(seconds, self._close, connection)

    def _close(self, connection: Connection) -> None:
        self._forget(connection)
        if connection.transport and not connection.done:
            self.closed += 1
            connection.transport.abort()

    async def _make_room(self) -> None:
        loop = asyncio.get_running_loop()
        while len(self._waiting) >= self._max_waiting:
            if ended := next((each for each in self._waiting if each.done), None):
                self._forget(ended)
                continue
            oldest = next((each for each in self._waiting if not each.sends), None)
            age = loop.time() - oldest.since if oldest else 0.0
            if oldest and age >= MIN_AGE:
                self._close(oldest)
            else:
                await asyncio.sleep(MIN_AGE - age)

    def _refused(self, error: OSError) -> None:
        """Log once that the system refuses new connections, and close idle ones."""
        if not self.errors:
            sys.stderr.write(f"page: new connections are paused: {error.strerror}\n")
        self.errors += 1
        for connection in [*self._waiting]:
            self._close(connection)
