"""The page's server: one thread with an event loop, whose clients delay neither the run nor each other.

A new update is only stored. At a steady pace the newest update is encoded once for all clients; each client
gets the newest encoding as soon as it has received the previous one, so that a slow client gets fewer, and
one that never reads is closed. Nothing is queued except in the system's buffers.
"""

import asyncio
import errno
import ipaddress
import logging
import socket
import threading
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Awaitable, Callable, Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from importlib.resources import files
from types import TracebackType
from typing import Any, Self
from urllib.parse import quote

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from monochord.capture.sources.base import Controls
from monochord.core.errors import DeviceError
from monochord.core.timing import Histogram
from monochord.core.types import Signal
from monochord.core.units import Metres, Seconds
from monochord.live.update import Update
from monochord.live.web import messages
from monochord.live.web.access import Guard, page_name
from monochord.live.web.connections import Connections, share_of_descriptors
from monochord.live.web.tasks import Tasks

PORTS = range(8420, 8440)
"""Ports to try where none is given; the first free one is used."""
RATE = 30.0
"""Most messages per second to a client."""
TOTAL_RATE = 1500.0
"""Most messages per second to all clients together: with more than 50 clients, each gets fewer."""
SPECTRUM_RATE = 15.0
HISTORY: Seconds = 30.0
"""Length of history sent to a newly opened page, in s."""
MAX_CLIENTS = 256
"""Most open pages; fewer where this process may open fewer than four files for each."""
BACKLOG = 4096
"""Most connections that wait in the system to be accepted, in order of arrival."""
MAX_MESSAGE = 1024
"""Largest message from a client, in bytes."""
MIN_PAUSE: Seconds = 0.004
"""Shortest time between a client's messages, in s: a flood waits in that client's connection."""
PATIENCE: Seconds = 10.0
"""Time for a client to receive one message before it is closed, in s."""
HOLD: Seconds = 1.5
"""How long a touch lasts without a message from the page that holds it, in s."""
EDGES: tuple[Seconds, ...] = tuple(1e-4 * 10.0 ** (k / 8) for k in range(25))
"""Bin edges of the latency histogram: eight per decade, 0.1 to 100 ms."""
EVENTS = 8
"""Number of newest events in a message."""
TYPES = {"html": "text/html", "js": "text/javascript", "css": "text/css", "svg": "image/svg+xml"}
PAGE = {
    "/": "index.html",
    **{
        f"/static/{name}": name
        for name in (
            "page.css", "page.js", "state.js", "string.js", "spectrum.js", "history.js", "numbers.js",
            "touch.js", "tasks.js", "label.js", "strings.js", "sections.js", "icon.svg",
            "uplot/uPlot.iife.min.js", "uplot/uPlot.min.css", "theme.js", "plot.js",
        )
    },
}  # fmt: skip
"""Files of the page by path; no other file is served."""
TABS = b"<!--tabs-->"
"""Where a page's file has the links to the server's pages."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A further page of the server: its path, the label of its tab, and its routes.

    `routes` gets a function that adds the tabs to the page's file. `close` is awaited as the server ends.
    """

    path: str
    title: str
    routes: Callable[[Callable[[bytes], bytes]], Sequence[BaseRoute]]
    close: Callable[[], Awaitable[None]] | None = None


class Server:
    """A running server; leaving the context ends it.

    Parameters
    ----------
    host, port
        Address to listen at; port 0 is the first free one of `PORTS`.
    token
        The required token; empty for none.
    first
        With several strings, the string a page shows at first; empty for the first string.
    names
        Further host names of the page, each NAME or NAME:PORT.
    home
        Path of the page that opens where no run is shown, such as ``design``; empty for a run.
    parts
        Further pages.

    Raises
    ------
    DeviceError
        If the address is taken or belongs to another machine.
    InputError
        If a name is not a valid host name.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str = "",  # nosec B107
        *,
        first: str = "",
        names: Sequence[str] = (),
        home: str = "",
        parts: Sequence[Part] = (),
    ) -> None:
        names = tuple(map(page_name, names))
        self._host, self._socket = host, _bound(host, port)
        self.port: int
        bound, self.port = self._socket.getsockname()[:2]
        self._guard = Guard(host=host, port=self.port, token=token, names=names)
        self._connections = Connections(self._socket, self._protocol)
        self._max_clients = share_of_descriptors(4, MAX_CLIENTS)
        self._everywhere = ipaddress.ip_address(bound).is_unspecified
        self._stage = _Stage(first=first)
        tabs = {} if home else {"": "Live"}
        self._tabs = tabs | {part.path: part.title for part in parts}
        self._parts = tuple(parts)
        routes = [route for part in parts for route in part.routes(partial(self._with_tabs, part.path))]
        files_ = {path: _file(name) for path, name in PAGE.items() if path != "/" or not home}
        app = Starlette(
            routes=[
                *(
                    Route(path, _serving(self._with_tabs(path[1:], each), kind))
                    for path, (each, kind) in files_.items()
                ),
                Route("/", lambda _: RedirectResponse(home, 303)),
                WebSocketRoute("/live", self._live),
                *routes,
            ]
        )
        config = uvicorn.Config(
            self._connections.around(self._guard.around(app)),  # pyright: ignore[reportArgumentType]
            http="h11", ws="websockets-sansio", loop="asyncio", lifespan="off", log_config=None,
            access_log=False, server_header=False, proxy_headers=False, ws_max_size=MAX_MESSAGE,
            ws_max_queue=4, ws_per_message_deflate=False, limit_concurrency=2 * self._max_clients,
            timeout_graceful_shutdown=1,
        )  # fmt: skip
        # What a client sent that is no HTTP is none of the terminal's, where the live view is drawn.
        logging.getLogger("uvicorn").addHandler(logging.NullHandler())
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._run, name="web", daemon=True)
        self._ready = threading.Event()

    def __enter__(self) -> Self:
        self._thread.start()
        self._ready.wait(PATIENCE)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stage.closing = True
        self._server.should_exit = True
        self._thread.join(PATIENCE)
        self._socket.close()

    @property
    def address(self) -> str:
        """The page's address for a browser, with its token if any."""
        host, token = socket.gethostname() if self._everywhere else self._host, self._guard.token
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}/" + (f"?token={quote(token, safe='')}" if token else "")

    @property
    def counts(self) -> Mapping[str, int]:
        """Number of clients now and in total, of messages sent to them, and of ignored messages.

        Also the number of connections closed without a request, and of connections refused by the system.
        """
        stage, connections = self._stage, self._connections
        return {
            "clients": len(stage.clients),
            "served": stage.served,
            "sent": stage.sent,
            "ignored": stage.ignored,
            "closed": connections.closed,
            "errors": connections.errors,
        }

    def _with_tabs(self, path: str, content: bytes) -> bytes:
        """Return a page's file with the links to all pages."""
        current = {path: ' aria-current="page"'}
        links = (
            f'<a href="{each or "./"}"{current.get(each, "")}>{title}</a>'
            for each, title in self._tabs.items()
        )
        return content.replace(TABS, "".join(links).encode())

    @contextmanager
    def show(
        self,
        signal: Signal,
        length: Metres,
        controls: Controls | None,
        *,
        string: str = "",
        tasks: Tasks | None = None,
    ) -> Generator["View"]:
        """Show a run, or one of its strings by name: the view takes its updates.

        `tasks` are what the page can ask for beside touches, and are closed at the end.
        """
        self._stage.views[string] = view = View(signal, length, controls, tasks)
        try:
            yield view
        finally:
            if tasks is not None:
                tasks.close()

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        stage = self._stage
        stage.loop = asyncio.get_running_loop()
        pace, taking = map(asyncio.create_task, (stage.keep_pace(), self._connections.take()))
        stage.loop.call_soon(self._ready.set)
        try:
            await self._server.serve(sockets=[])  # they are taken here, where their number is bounded
        finally:
            for task in (pace, taking):
                task.cancel()
            await asyncio.gather(pace, taking, return_exceptions=True)
            for close in (part.close for part in self._parts):
                if close is not None:
                    await close()

    def _protocol(self, state: dict[str, Any]) -> asyncio.Protocol:
        """Return uvicorn's protocol for a connection."""
        config = self._server.config
        if not config.loaded:
            config.load()
        make: Any = config.http_protocol_class
        return make(config=config, server_state=self._server.server_state, app_state=state)

    async def _live(self, socket_: WebSocket) -> None:
        stage = self._stage
        if len(stage.clients) >= self._max_clients:
            await socket_.close(1013, "too many pages are open")
            return
        await socket_.accept()
        client = _Client(socket_)
        stage.clients.add(client)
        stage.served += 1
        sending = asyncio.create_task(client.send(stage))
        try:
            await client.receive(stage)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            sending.cancel()
            with suppress(asyncio.CancelledError):
                await sending
            stage.clients.discard(client)
            client.let_go(stage)


@dataclass(eq=False, slots=True)
class _Stage:
    """State shared by all clients, used in the server's thread only, except `views` and `closing`."""

    first: str = ""
    views: "dict[str, View]" = field(default_factory=dict)
    closing: bool = False
    loop: asyncio.AbstractEventLoop | None = None
    clients: "set[_Client]" = field(default_factory=set)
    served: int = 0
    sent: int = 0
    ignored: int = 0

    def view(self, string: str) -> "View | None":
        """Return a string's latest view: the first string's for an unknown name, None before any data."""
        views = self.views
        return views.get(string) or views.get(self.first) or next(iter(tuple(views.values())), None)

    async def keep_pace(self) -> None:
        """Encode the newest update and wake the clients, at the permitted rate."""
        while not self.closing:
            await asyncio.sleep(max(1.0 / RATE, len(self.clients) / TOTAL_RATE))
            views = tuple(self.views.values())
            fresh = [view for view in views if view.remember()]
            if not (fresh and self.clients):
                continue
            extra: dict[str, Any] = {"server": {"clients": len(self.clients), "ignored": self.ignored}}
            if len(views) > 1:
                extra["strings"] = [messages.string_summary(view.newest) for view in views if view.newest]
            watched = {self.view(client.string) for client in self.clients}
            for view in fresh:
                if view in watched:
                    view.encode(extra)
            for client in self.clients:
                client.wake.set()


class _Client:
    """An open page."""

    def __init__(self, connection: WebSocket) -> None:
        self._socket = connection
        self.wake = asyncio.Event()
        self.wake.set()
        self.string = ""
        self._holds = False
        self._last_received: Seconds = 0.0

    async def send(self, stage: _Stage) -> None:
        """Send the newest data whenever there is something new."""
        view: View | None = None
        spectrum_number = number = 0
        try:
            await self._text(messages.waiting())
            while True:
                with suppress(TimeoutError):
                    await asyncio.wait_for(self.wake.wait(), 0.5)
                self.wake.clear()
                if self._holds and time.monotonic() > self._last_received + HOLD:
                    self.let_go(stage)
                newest = stage.view(self.string)
                if newest is None:
                    continue
                if newest is not view:
                    view, number, spectrum_number = newest, newest.number, newest.spectrum_number
                    await self._text(messages.packed(newest.hello()))
                if newest.number != number:
                    number = newest.number
                    await self._text(newest.text)
                    stage.sent += 1
                if newest.spectrum_number != spectrum_number:
                    spectrum_number = newest.spectrum_number
                    async with asyncio.timeout(PATIENCE):
                        await self._socket.send_bytes(newest.spectrum)
                    stage.sent += 1
        except TimeoutError:
            with suppress(RuntimeError, TimeoutError):
                async with asyncio.timeout(1.0):
                    await self._socket.close(1008, "nothing was read for too long")
        except (WebSocketDisconnect, RuntimeError, OSError):
            pass  # it went away

    async def receive(self, stage: _Stage) -> None:
        """Carry out the client's requests until it leaves; unreadable ones are counted."""
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            content = message.get("text") or message.get("bytes") or b""
            view = stage.view(self.string)
            controls, tasks = (None, None) if view is None else (view.controls, view.tasks)
            done = messages.carry_out(content, controls, tasks, lambda name: self.show(stage, name))
            if done is None:
                stage.ignored += 1
            self._holds = done == "touch" or (self._holds and done != "release")
            self._last_received = time.monotonic()
            await asyncio.sleep(MIN_PAUSE)

    def show(self, stage: _Stage, string: str) -> bool:
        """Show another string from now on; return whether a string of that name exists."""
        if string not in stage.views:
            return False
        self.let_go(stage)
        self.string = string
        self.wake.set()
        return True

    def let_go(self, stage: _Stage) -> None:
        """Release the object that this page holds."""
        view = stage.view(self.string)
        if self._holds and view is not None and view.controls is not None:
            view.controls.release()
        self._holds = False

    async def _text(self, text: str) -> None:
        async with asyncio.timeout(PATIENCE):
            await self._socket.send_text(text)


class View:
    """A run as shown on the page: `write` runs in a sink's thread, all else in the server's."""

    def __init__(
        self, signal: Signal, length: Metres, controls: Controls | None, tasks: Tasks | None
    ) -> None:
        self._signal, self._length, self.controls, self.tasks = signal, length, controls, tasks
        self.newest: Update | None = None
        self.text, self.number = "", 0
        self.spectrum, self.spectrum_number = b"", 0
        self._remembered: Update | None = None
        self._spectrum_due: Seconds = 0.0
        self._latency = Histogram()
        self._counts = [0] * (len(EDGES) + 1)
        self._history: deque[list[float | None]] = deque(maxlen=round(HISTORY * RATE))
        self._events: deque[dict[str, Any]] = deque(maxlen=EVENTS)
        self._event = 0
        self._timing: dict[str, Any] | None = None
        self._timing_due: Seconds = 0.0
        self._simulated = controls is not None

    def write(self, update: Update) -> None:
        """Take the newest update."""
        latency = update.prediction.latency
        self._latency.add(latency)
        self._counts[bisect_right(EDGES, latency)] += 1
        self._simulated = self._simulated or bool(update.truth)
        for event in update.events:
            self._event += 1
            self._events.append(messages.event(event, self._event))
        self.newest = update
        if self.tasks is not None:
            self.tasks.take(update)

    def remember(self) -> bool:
        """Add the newest update to the history; return whether there was a new one."""
        update = self.newest
        if update is None or update is self._remembered:
            return False
        self._remembered = update
        self._history.append(messages.row(update))
        return True

    def encode(self, extra: dict[str, Any]) -> None:
        """Encode the newest update with its accompanying data, and at times its spectrum."""
        update, now = self.newest, time.monotonic()
        if update is None:
            return
        self.text = messages.packed(self._state(update, now) | extra)
        self.number += 1
        if now >= self._spectrum_due:
            self._spectrum_due = now + 0.9 / SPECTRUM_RATE
            self.spectrum = messages.spectrum(update.window.samples, update.window.sample_rate)
            self.spectrum_number += 1

    def hello(self) -> dict[str, Any]:
        """Return the data that a newly opened page needs."""
        about = messages.hello(self._signal, self._length, self._simulated, self.controls)
        return about | {"history": list(self._history), "events": list(self._events)}

    def _state(self, update: Update, now: Seconds) -> dict[str, Any]:
        """Return the new state, with timing twice a second."""
        state = messages.state(update) | {"events": list(self._events), "simulated": self._simulated}
        if self.tasks is not None:
            state["tasks"] = self.tasks.state()
        if self.controls is not None:
            state["settings"] = messages.settings(self.controls)
        if now >= self._timing_due:
            self._timing_due = now + 0.5
            state["timing"] = messages.timing(self._latency.percentiles(), list(self._counts), EDGES)
        return state


def _bound(host: str, port: int) -> socket.socket:
    """Return a socket bound to an address of this machine."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    reason: OSError | None = None
    for number in [port] if port else [*PORTS, 0]:
        sock = socket.socket(family, socket.SOCK_STREAM)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            sock.bind((host, number))
            sock.listen(BACKLOG)  # from now on no other process can have it
        except OSError as error:
            sock.close()
            reason = error
            if error.errno != errno.EADDRINUSE:
                break
        else:
            return sock
    assert reason is not None
    hint = "; use another port, or omit it" if reason.errno == errno.EADDRINUSE else ""
    raise DeviceError(f"page at {host}:{port}: {reason.strerror or reason}{hint}") from reason


def _file(name: str) -> tuple[bytes, str]:
    content = files("monochord.live.web").joinpath("static", *name.split("/")).read_bytes()
    return content, TYPES[name.rpartition(".")[2]]


def _serving(content: bytes, kind: str) -> Any:
    async def serve(_: Request) -> Response:
        return Response(content, media_type=kind)

    return serve
