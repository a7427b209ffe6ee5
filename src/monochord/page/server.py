"""The server of pages: one thread with an event loop; clients delay neither the program nor each other."""

import asyncio
import errno
import ipaddress
import logging
import socket
import threading
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from types import MappingProxyType, TracebackType
from typing import Any, Self
from urllib.parse import quote

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute

from monochord.core.errors import DeviceError
from monochord.core.units import Seconds
from monochord.page.clients import MAX_CLIENTS, Clients, Feed
from monochord.page.connections import Connections, share_of_descriptors
from monochord.page.guard import Guard, page_name

PORTS = range(8420, 8440)
"""Ports to try where none is given; the first free one is used."""
BACKLOG = 4096
"""Most connections that wait in the system to be accepted, in order of arrival."""
MAX_MESSAGE = 1024
"""Largest message from a client, in bytes."""
PATIENCE: Seconds = 10.0
"""Time for the server to start, and to end, in s."""
TYPES = {"html": "text/html", "js": "text/javascript", "css": "text/css", "svg": "image/svg+xml"}
SHARED = (
    "page.css", "icon.svg", "theme.js", "connection.js", "plot.js", "uplot/uPlot.iife.min.js",
    "uplot/uPlot.min.css",
)  # fmt: skip
"""Files that pages share; beside them and the pages' files, no other file is served."""
TABS = b"<!--tabs-->"
"""Where a page's file has the links to the server's pages."""
NO_FILES: Mapping[str, bytes] = MappingProxyType({})


def static(package: str, *names: str) -> dict[str, bytes]:
    """Return files of a package's folder ``static`` by name.

    >>> [*static("monochord.page", "theme.js")]
    ['theme.js']
    """
    folder = files(package).joinpath("static")
    return {name: folder.joinpath(*name.split("/")).read_bytes() for name in names}


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """A page of the server.

    `path` is its address on the server, empty for the server's root, and `title` the label of its tab. `html`
    is its file, with `TABS` where the links to all pages go, and `files` are served below ``static/``, by
    name. A page with a `feed` is live: its browsers connect to the path `socket`. `routes` are further
    answers. `close` is awaited as the server ends.
    """

    path: str
    title: str
    html: bytes
    files: Mapping[str, bytes] = field(default_factory=lambda: NO_FILES)
    feed: Feed | None = None
    socket: str = "live"
    routes: Sequence[BaseRoute] = ()
    close: Callable[[], Awaitable[None]] | None = None


class Server:
    """A running server; leaving the context ends it.

    The first of its `pages` opens at the server's root; `port` 0 is the first free one of `PORTS`, and
    `names` are further host names of the page, NAME or NAME:PORT. An empty `token` requires none. Raises
    `DeviceError` if the address is taken or belongs to another machine, `InputError` if a name is not a valid
    host name.
    """

    def __init__(
        self,
        pages: Sequence[Page],
        host: str = "127.0.0.1",
        port: int = 0,
        token: str = "",  # nosec B107
        *,
        names: Sequence[str] = (),
    ) -> None:
        names = tuple(map(page_name, names))
        self._host, self._socket = host, _bound(host, port)
        self.port: int
        bound, self.port = self._socket.getsockname()[:2]
        self._guard = Guard(host=host, port=self.port, token=token, names=names)
        self._connections = Connections(self._socket, self._protocol)
        self._everywhere = ipaddress.ip_address(bound).is_unspecified
        self._pages = tuple(pages)
        self._clients = {page.socket: Clients(page.feed) for page in pages if page.feed is not None}
        app = Starlette(routes=self._routes())
        config = uvicorn.Config(
            self._connections.around(self._guard.around(app)),  # pyright: ignore[reportArgumentType]
            http="h11", ws="websockets-sansio", loop="asyncio", lifespan="off", log_config=None,
            access_log=False, server_header=False, proxy_headers=False, ws_max_size=MAX_MESSAGE,
            ws_max_queue=4, ws_per_message_deflate=False,
            limit_concurrency=2 * share_of_descriptors(4, MAX_CLIENTS), timeout_graceful_shutdown=1,
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
        clients, connections = self._clients.values(), self._connections
        return {
            "clients": sum(map(len, clients)),
            "served": sum(each.served for each in clients),
            "sent": sum(each.sent for each in clients),
            "ignored": sum(each.ignored for each in clients),
            "closed": connections.closed,
            "errors": connections.errors,
        }

    def _routes(self) -> list[BaseRoute]:
        """Return what the server answers to, and nothing else."""
        shared = static("monochord.page", *SHARED)
        names = {name: content for page in self._pages for name, content in page.files.items()}
        return [
            *(Route(f"/{page.path}", _serving(self._with_tabs(page), "text/html")) for page in self._pages),
            Route("/", lambda _: RedirectResponse(self._pages[0].path, 303)),
            *(
                Route(f"/static/{name}", _serving(content, TYPES[name.rpartition(".")[2]]))
                for name, content in (shared | names).items()
            ),
            *(WebSocketRoute(f"/{path}", clients.serve) for path, clients in self._clients.items()),
            *(route for page in self._pages for route in page.routes),
        ]

    def _with_tabs(self, page: Page) -> bytes:
        """Return a page's file with the links to all pages."""
        current = ' aria-current="page"'
        links = (
            f'<a href="{each.path or "./"}"{current if each is page else ""}>{each.title}</a>'
            for each in self._pages
        )
        return page.html.replace(TABS, "".join(links).encode())

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        working = [asyncio.create_task(clients.keep_pace()) for clients in self._clients.values()]
        working.append(asyncio.create_task(self._connections.take()))
        asyncio.get_running_loop().call_soon(self._ready.set)
        try:
            await self._server.serve(sockets=[])  # they are taken here, where their number is bounded
        finally:
            for task in working:
                task.cancel()
            await asyncio.gather(*working, return_exceptions=True)
            for page in self._pages:
                if page.close is not None:
                    await page.close()

    def _protocol(self, state: dict[str, Any]) -> asyncio.Protocol:
        """Return uvicorn's protocol for a connection."""
        config = self._server.config
        if not config.loaded:
            config.load()
        make: Any = config.http_protocol_class
        return make(config=config, server_state=self._server.server_state, app_state=state)


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


def _serving(content: bytes, kind: str) -> Any:
    async def serve(_: Request) -> Response:
        return Response(content, media_type=kind)

    return serve
