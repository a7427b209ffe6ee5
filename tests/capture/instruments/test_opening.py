"""Devices that answer slowly, without end or with garbage while they are opened: a real server each."""

import re
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from monochord.capture.instruments.net_ft import NetFt
from monochord.core.errors import DeviceError

HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\n\r\n"
LONGEST_LINE = 300
PIECES = 600


@contextmanager
def serving(reply: Callable[[], Iterator[bytes]]) -> Generator[int]:
    """A TCP server that answers whatever it is asked, piece by piece; yields its port."""
    ended = threading.Event()

    def serve() -> None:
        while not ended.is_set():
            with suppress(OSError):
                client, _ = server.accept()
                with client:
                    client.settimeout(0.2)
                    client.recv(1000)
                    for piece in reply():
                        if ended.is_set():
                            break
                        client.sendall(piece)

    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.05)
        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield int(server.getsockname()[1])
        finally:
            ended.set()
            thread.join()


def trickle(begin: bytes = b"", piece: bytes = b" ") -> Iterator[bytes]:
    """A piece every 50 ms."""
    yield begin
    for _ in range(PIECES):
        time.sleep(0.05)
        yield piece


@pytest.mark.parametrize(
    ("begin", "piece"),
    [
        (b"HTTP/1.1 200 ", b"O"),
        (b"HTTP/1.1 200 OK\r\nX: ", b"x"),
        (HEAD + b"<netft>", b" "),
        (b"", b"HTTP/1.1 100 Continue\r\n\r\n"),
        (b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n", b"1\r\n \r\n"),
    ],
    ids=["status", "header", "body", "continue", "chunks"],
)
def test_settings_that_trickle_in_end_in_time(begin: bytes, piece: bytes) -> None:
    sent: list[bytes] = []

    def reply() -> Iterator[bytes]:
        for each in trickle(begin, piece):
            sent.append(each)
            yield each

    with (
        serving(reply) as port,
        pytest.raises(DeviceError),
        NetFt(http_port=port, timeout_seconds=0.3).open(),
    ):
        pass
    assert len(sent) < PIECES  # the opening ended before they did


@pytest.mark.parametrize(
    "reply",
    [
        b"\x1b]0;owned\x07\x1b[2J" * 4000 + b"\r\n\r\n",
        b"\xff" * 100_000,
        b"HTTP/1.1 \x1b[31m OK\r\n\r\n",
        b"HTTP/1.1 200 OK\r\n" + b"X: y\r\n" * 200 + b"\r\n",
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n\x1b[31mzz\r\n" + b"x" * 100,
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n-5\r\nhello\r\n0\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nContent-Length: 9999999\r\n\r\n<a/>",
        b"HTTP/1.1 418 \x1b[5m\r\n\r\n",
        HEAD,
        HEAD + b"\x1b[2J\x00\x9b31m" * 1000,
        HEAD + b"<a>" + b" " * (2 << 20) + b"</a>",
        HEAD + b"<a>&" + b"x" * 90_000 + b";</a>",
        HEAD + b"<a>" * 100_000 + b"</a>" * 100_000,
        HEAD + b"<a><cfgcpf>\x1b]8;;http://x\x07" + b"9" * 90_000 + b"</cfgcpf></a>",
        HEAD + "<a><cfgcpf>\u202e\u20289</cfgcpf></a>".encode(),
        HEAD + b"<a><cfgcpf>1</cfgcpf><scfgfu>" + b"stone" * 10_000 + b"</scfgfu></a>",
        HEAD + b"<a><cfgcpf>1e-300</cfgcpf></a>",
        HEAD + b"<a><cfgcpf>1</cfgcpf><cfgcpt>1</cfgcpt></a>",
        HEAD + b"<a><cfgcpf>1</cfgcpf><cfgfu>" + b"7" * 90_000 + b"</cfgfu></a>",
        HEAD + b"<a><cfgcpf>1</cfgcpf><scfgfu>N</scfgfu><cfgfu>\x1b[1</cfgfu></a>",
        HEAD
        + b"<a><cfgcpf>1</cfgcpf><cfgfu>2</cfgfu><cfgcpt>1</cfgcpt><cfgtu>3</cfgtu>"
        + b"<comrdtrate>1e300</comrdtrate></a>",
    ],
)
def test_garbage_is_one_short_plain_line(reply: bytes) -> None:
    with (
        serving(lambda: iter([reply])) as port,
        pytest.raises(DeviceError, match=r"127\.0\.0\.1") as caught,
        NetFt(http_port=port).open(),
    ):
        pass
    line = str(caught.value)
    assert re.fullmatch("[ -~]+", line)
    assert len(line) < LONGEST_LINE


def test_the_first_record_is_part_of_the_same_time() -> None:
    page = b"<a><cfgcpf>1000</cfgcpf><cfgfu>2</cfgfu><cfgcpt>1000</cfgcpt><cfgtu>3</cfgtu></a>"

    def late() -> Iterator[bytes]:
        time.sleep(0.6)
        yield HEAD + page

    with serving(late) as port, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        deaf.bind(("127.0.0.1", 0))
        box = NetFt(address=f"127.0.0.1:{deaf.getsockname()[1]}", http_port=port, timeout_seconds=0.8)
        begun = time.monotonic()
        with pytest.raises(DeviceError), box.open():
            pass
        assert 0.7 < time.monotonic() - begun < 1.4  # not the 0.6 s of the page and 0.8 s more


@pytest.mark.parametrize("host", ["..", "a" * 300, "a\0b"])
def test_what_cannot_be_a_name_is_an_error_of_the_device(host: str) -> None:
    with pytest.raises(DeviceError), NetFt(address=host).open():
        pass


def test_a_name_server_that_never_answers_ends_in_time(tmp_path: Path) -> None:
    (tmp_path / "resolv.conf").write_text("nameserver 127.0.0.1\n", encoding="ascii")
    code = """
import socket
from monochord.core.errors import DeviceError
from monochord.capture.instruments.net_ft import NetFt
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
    deaf.bind(("127.0.0.1", 53))
    try:
        with NetFt(address="box.example", timeout_seconds=0.5).open():
            pass
    except DeviceError as error:
        print(error)
"""
    alone = ["unshare", "--net", "--mount", "sh", "-c"]
    place = f"mount --bind {tmp_path}/resolv.conf /etc/resolv.conf && ip link set lo up"
    if (
        not (shutil.which("unshare") and shutil.which("ip"))
        or subprocess.run([*alone, place], capture_output=True, check=False).returncode
    ):
        pytest.skip("a name server of its own takes root, unshare and iproute2")
    command = [*alone, f'{place} && exec "$0" -c "$1"', sys.executable, code]
    run = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    (line,) = run.stdout.splitlines()
    assert "'box.example'" in line
    assert "0.5 s" in line
