"""Poses and numbers as JSON over real UDP."""

import json
import socket
from collections.abc import Iterator
from pathlib import Path

from tests.fuzz.base import Input, Target
from tests.fuzz.mutate import datagrams, packets
from tests.fuzz.targets._feeds import recorded

from monochord.capture.instruments import INSTRUMENTS
from monochord.core.errors import InputError

SENT = {
    "udp": {"stamp": 1.5, "sequence": 7, "values": {"temperature": 293.1, "door": 1}},
    "pose_udp": {
        "stamp": 1.5,
        "position": [0.1, 0.0, 0.0],
        "orientation": [0.0, 0.0, 0.0, 1.0],
        "sequence": 7,
    },
}


class Fuzz(Target):
    """A feed of each kind, recorded."""

    def seeds(self, folder: Path) -> Iterator[Input]:
        for name, each in SENT.items():
            messages = [json.dumps({**each, "sequence": k, "stamp": 0.01 * k}).encode() for k in range(12)]
            yield {f"{name}.packets": packets(messages)}

    def run(self, folder: Path) -> None:
        names = [name for name in SENT if (folder / f"{name}.packets").exists()]
        if not names:
            raise InputError("no datagrams", "some")
        sent = datagrams((folder / f"{names[0]}.packets").read_bytes())[:200]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.bind(("127.0.0.1", 0))
            address = f"127.0.0.1:{sock.getsockname()[1]}"
        more = {"columns": ["temperature", "door"]} if names[0] == "udp" else {}
        instrument = INSTRUMENTS.build(names[0], {"address": address, **more})
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.connect(("127.0.0.1", int(address.rpartition(":")[2])))

            def feed() -> None:
                for _ in range(50):
                    if sent:
                        sender.send(sent.pop(0))

            recorded(instrument, folder.with_name("take.mcap"), max_readings=len(sent), feed=feed)
