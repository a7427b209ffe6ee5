"""Connections that ask nothing: they are few, they end, and nobody is kept out by them."""

import socket
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager, suppress

import pytest
from tests.live.web.test_server import TOKEN, get, live, messages_of, running
from websockets.sync.client import ClientConnection

from monochord.page.connections import DEADLINE, MAX_WAITING

HEAD = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"


@contextmanager
def silent(port: int, count: int) -> Generator[list[socket.socket]]:
    """Connect so many times, and ask nothing."""
    with ExitStack() as stack:
        yield [stack.enter_context(socket.create_connection(("127.0.0.1", port), 30)) for _ in range(count)]


def is_closed(sock: socket.socket) -> bool:
    sock.setblocking(False)
    try:
        return sock.recv(1 << 16) == b""
    except BlockingIOError:
        return False
    except ConnectionError:
        return True


def follows(client: ClientConnection, count: int = 10) -> None:
    messages_of(client, "moment", count)


def test_of_those_that_ask_nothing_few_stay_and_nobody_is_kept_out() -> None:
    cookie = f"monochord={TOKEN}"
    with running(token=TOKEN) as (server, _), live(server, additional_headers={"Cookie": cookie}) as client:
        follows(client)
        with silent(server.port, 300) as strangers:
            deadline = time.monotonic() + 30
            while sum(not is_closed(each) for each in strangers) > MAX_WAITING:
                assert time.monotonic() < deadline
                time.sleep(0.05)
            assert is_closed(strangers[0])
            assert not is_closed(strangers[-1])
            assert {get(server, "/", Cookie=cookie).status for _ in range(10)} == {200}
            follows(client)
            # One that keeps its connection, as browsers do, is answered there again and again.
            with socket.create_connection(("127.0.0.1", server.port), 30) as kept:
                for _ in range(20):
                    kept.sendall(HEAD + f"Cookie: {cookie}\r\n\r\n".encode())
                    answer = b""
                    while b"</html>" not in answer:
                        part = kept.recv(1 << 16)
                        assert part
                        answer += part
            assert server.counts["closed"] >= 300 - MAX_WAITING


@pytest.mark.slow
@pytest.mark.real_time
def test_a_request_has_a_deadline_however_slowly_it_comes() -> None:
    with running() as (server, _):
        begins: dict[str, bytes] = {
            "nothing": b"",
            "half a head": HEAD,
            "a head that drips": HEAD + b"X: ",
            "a body that drips": HEAD + b"Content-Length: 1000000\r\n\r\n",
            "another request that drips": HEAD + b"\r\nGET",
        }
        with silent(server.port, len(begins)) as sockets, live(server) as client:
            begin = time.monotonic()
            for sock, content in zip(sockets, begins.values(), strict=True):
                sock.sendall(content)
            ended: dict[str, float] = {}
            while len(ended) < len(begins) and time.monotonic() < begin + 2 * DEADLINE:
                follows(client)  # an open page has none
                for name, sock in zip(begins, sockets, strict=True):
                    if name not in ended and is_closed(sock):
                        ended[name] = time.monotonic() - begin
                    elif "drips" in name and name not in ended:
                        with suppress(OSError):
                            sock.send(b"a")
            assert set(ended) == set(begins)
            assert max(ended.values()) < DEADLINE + 3.0
            assert min(ended.values()) > DEADLINE - 1.0
            follows(client)


def test_whoever_is_refused_is_not_kept() -> None:
    with running(token=TOKEN) as (server, _), silent(server.port, 1) as (sock,):
        sock.sendall(HEAD + b"\r\n")
        answer = b""
        while part := sock.recv(1 << 16):
            answer += part
        assert answer.startswith(b"HTTP/1.1 401")


EXHAUSTED = """
import resource, socket, sys, time
resource.setrlimit(resource.RLIMIT_NOFILE, (128, 128))
from monochord.live.web.run_page import RunPage
from monochord.page.server import Server
with Server([RunPage().page], token="right") as server:
    def ask():
        with socket.create_connection(("127.0.0.1", server.port), 10) as client:
            client.sendall(b"GET / HTTP/1.1\\r\\nHost: 127.0.0.1\\r\\nCookie: monochord=right\\r\\n\\r\\n")
            return client.recv(15)
    print(ask())
    with socket.create_connection(("127.0.0.1", server.port), 10) as client:  # what is no HTTP prints nothing
        client.sendall(b"no http\\r\\n\\r\\n")
        while client.recv(4096):
            pass
    asked = [socket.socket() for _ in range(20)]
    files = []
    try:
        while True:
            files.append(open("/dev/null"))
    except OSError:
        pass
    for client in asked:
        client.connect(("127.0.0.1", server.port))
    time.sleep(1.5)
    print(server.counts["errors"] >= 3)
    for file in files:
        file.close()
    print(ask())
"""


def test_where_the_process_has_no_descriptors_left_one_line_is_printed_and_the_page_comes_back() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", EXHAUSTED], capture_output=True, text=True, timeout=60, check=True
    )
    assert ended.stdout.splitlines() == ["b'HTTP/1.1 200 OK'", "True", "b'HTTP/1.1 200 OK'"]
    assert len(ended.stderr.splitlines()) == 1
    assert "Too many open files" in ended.stderr


FEW = """
import os, resource, socket, sys
resource.setrlimit(resource.RLIMIT_NOFILE, (256, 4096))
from monochord.live.web.run_page import RunPage
from monochord.page.server import Server
with Server([RunPage().page]) as server:
    print(server.port, flush=True)
    for line in sys.stdin:
        print(len(os.listdir("/proc/self/fd")), server.counts["clients"], flush=True)
"""


def test_pages_and_strangers_leave_descriptors_to_the_rest_of_the_process() -> None:
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", FEW]
    upgrade = HEAD.replace(b"/ ", b"/live ", 1) + (
        b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    )
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdin
        assert process.stdout
        port = int(process.stdout.readline())
        with silent(port, 300) as pages, silent(port, 300):
            for page in pages:
                with suppress(OSError):
                    page.sendall(upgrade)
            time.sleep(3.0)
            process.stdin.write("\n")
            process.stdin.flush()
            descriptors, clients = map(int, process.stdout.readline().split())
        _, errors = process.communicate(timeout=30)
    assert errors == ""
    assert clients <= 64
    assert descriptors < 128
