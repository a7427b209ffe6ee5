"""A force sensor over real UDP and HTTP that answers anything."""

import socket
import struct
import threading
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.fuzz.base import Input, Target
from tests.fuzz.mutate import datagrams, packets
from tests.fuzz.targets._feeds import recorded

from monochord.capture.instruments.net_ft import NetFt
from monochord.lab.net_ft_device import NetFtSettings, _page

RECORD = struct.Struct(">IIIiiiiii")
STREAM = struct.pack(">HHI", 0x1234, 2, 0)


@contextmanager
def device(  # noqa: C901  (two servers)
    answer: bytes, records: list[bytes]
) -> Generator[tuple[int, int]]:
    """Answer one request over HTTP, and the request to stream with the records; give both ports."""
    with (
        socket.create_server(("127.0.0.1", 0)) as web,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as feed,
    ):
        feed.bind(("127.0.0.1", 0))
        ended = threading.Event()
        for each in (web, feed):
            each.settimeout(0.02)

        def serve() -> None:
            while not ended.is_set():
                try:
                    client, _ = web.accept()
                except OSError:
                    continue
                with client:
                    client.settimeout(0.5)
                    try:
                        client.recv(4096)
                        client.sendall(answer)
                    except OSError:
                        continue
                return

        def stream() -> None:
            while not ended.is_set():
                try:
                    request, sender = feed.recvfrom(64)
                    if request == STREAM:
                        for record in records[:200]:
                            feed.sendto(record, sender)
                except OSError:
                    continue

        threads = [threading.Thread(target=each, daemon=True) for each in (serve, stream)]
        for thread in threads:
            thread.start()
        try:
            yield web.getsockname()[1], feed.getsockname()[1]
        finally:
            ended.set()
            for thread in threads:
                thread.join()


class Fuzz(Target):
    """Settings in XML over HTTP, then records over UDP, written into a session and read again."""

    def seeds(self, folder: Path) -> Iterator[Input]:
        page = _page(NetFtSettings())
        answer = b"HTTP/1.0 200 OK\r\nContent-Type: text/xml\r\nContent-Length: %d\r\n\r\n%s" % (
            len(page),
            page,
        )
        for first in (1, 2**32 - 20):
            records = [
                RECORD.pack((first + k) % 2**32, (7 * first + k) % 2**32, 0, 1000 * k, 0, -5, 7, 8, 9)
                for k in range(40)
            ]
            yield {"settings.http": answer, "records.packets": packets(records)}
            yield {
                "settings.http": answer.partition(b"Content-Length")[0] + b"\r\n" + page,
                "records.packets": packets(records),
            }

    def run(self, folder: Path) -> None:
        parts = {file.name: file.read_bytes() for file in folder.iterdir()}
        records = datagrams(parts.get("records.packets", b""))
        with device(parts.get("settings.http", b""), records) as (http, port):
            sensor = NetFt(
                address=f"127.0.0.1:{port}", http_port=http, timeout_seconds=0.05, silence_seconds=0.01
            )
            recorded(sensor, folder.with_name("take.mcap"), max_readings=4 * len(records))
