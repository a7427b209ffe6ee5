"""The page with a token in a real Chromium: two of a host at once, and one in a proxy's folder."""

import re
import socket
import threading
from collections.abc import Generator
from contextlib import ExitStack, contextmanager, suppress

import pytest
from tests.e2e.browser import Page, chromium, opened
from tests.live.web.run_server import RunServer
from tests.live.web.test_server import SIGNAL, Run, free

from monochord.page.server import Server

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed (Debian: apt install chromium)"),
]
LIVE = "document.getElementById('connection')?.dataset.state === 'live'"
FOLDER = "/monochord"


@contextmanager
def shown(token: str, *names: str) -> Generator[Server]:
    with (
        RunServer(port=free(), token=token, names=names) as server,
        server.show(SIGNAL, 0.2, None) as writer,
        Run(writer),
    ):
        yield server


def copied(source: socket.socket, target: socket.socket) -> None:
    with suppress(OSError):
        while part := source.recv(1 << 16):
            target.sendall(part)
        target.shutdown(socket.SHUT_WR)


def forwarded(client: socket.socket, port: int, host: str | None) -> None:
    """Pass on one request, without its folder and perhaps with another Host, and all that follows it."""
    with client, suppress(OSError), socket.create_connection(("127.0.0.1", port)) as server:
        head = b""
        while b"\r\n\r\n" not in head:
            part = client.recv(1 << 16)
            if not part:
                return
            head += part
        head = head.replace(f" {FOLDER}/".encode(), b" /", 1)
        if b"Upgrade: websocket" not in head:
            head = head.replace(b"Connection: keep-alive", b"Connection: close")
        if host:
            head = re.sub(rb"Host: [^\r]+", f"Host: {host}".encode(), head, count=1)
        server.sendall(head)
        back = threading.Thread(target=copied, args=(server, client))
        back.start()
        copied(client, server)
        back.join()


@contextmanager
def proxied(listening: socket.socket, port: int, host: str | None = None) -> Generator[str]:
    """Serve a page in a folder, as a reverse proxy does, and return its address."""

    def serve() -> None:
        with suppress(OSError):
            while True:
                client, _ = listening.accept()
                threading.Thread(target=forwarded, args=(client, port, host), daemon=True).start()

    threading.Thread(target=serve, daemon=True).start()
    yield f"http://127.0.0.1:{listening.getsockname()[1]}{FOLDER}/"


def is_live(page: Page, address: str) -> None:
    page.call("Page.navigate", url=address)
    page.wait(LIVE)


def test_two_pages_of_a_host_are_open_beside_each_other() -> None:
    with shown("a&b#c+d é") as first, shown("other") as second, opened(first.address) as page:
        page.wait(LIVE)
        assert page.ask("location.search") == ""
        is_live(page, second.address)
        for server in (first, second):  # the browser is known at both
            is_live(page, server.address.partition("?")[0])
        assert page.complaints == []


@pytest.mark.parametrize("keeps_host", [True, False])
def test_behind_a_proxy_the_page_is_in_its_folder(*, keeps_host: bool) -> None:
    with ExitStack() as stack:
        listening = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        name = f"127.0.0.1:{listening.getsockname()[1]}"
        server = stack.enter_context(shown("right", *([] if keeps_host else [name])))
        host = None if keeps_host else f"127.0.0.1:{server.port}"
        address = stack.enter_context(proxied(listening, server.port, host))
        page = stack.enter_context(opened(f"{address}?token=right"))
        page.wait(LIVE)
        assert page.ask("location.href") == address
        assert all(request.startswith(address) for request in page.requests), page.requests
        assert page.complaints == []
