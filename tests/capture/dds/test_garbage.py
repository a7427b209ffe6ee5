"""Garbage sent to a domain's ports, from this machine and from another network."""

import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tests.networks import Networks

DOMAIN = 100 + os.getpid() % 99  # another run of the tests has another one
PORT = 7400 + 250 * DOMAIN + 10  # discovery of the first participant; the next is for messages
PACKETS = 10_000
LOGGED = 1000
"""Bytes that a listener may say of it all."""
GROWTH = 8 << 20

LISTEN = f"""
import sys, time
from pathlib import Path
from monochord.capture.dds import messages as ros
from monochord.capture.dds.participant import Participant

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

received = []
turn = ros.Quaternion(0.0, 0.0, 0.0, 1.0)
pose = ros.Pose(position=ros.Point(1.0, 0.0, 0.0), orientation=turn)
message = ros.PoseStamped(header=ros.header(1, "f"), pose=pose)
with Participant(domain={DOMAIN}) as here, Participant(domain={DOMAIN}) as there:
    here.reader("pose", "PoseStamped", lambda message, _: received.append(message))
    writer = there.writer("pose", "PoseStamped")
    while not writer.listeners:
        time.sleep(0.01)
    writer.write(message, 0)
    while not received:
        time.sleep(0.01)
    received.clear()
    before = resident()
    print("ready", flush=True)
    sys.stdin.readline()
    for k in range(200):
        writer.write(message, k)
        time.sleep(0.002)
    deadline = time.monotonic() + 30.0
    while len(received) < 200 and time.monotonic() < deadline:
        time.sleep(0.01)
    print(len(received), resident() - before, flush=True)
    sys.stdin.readline()
"""

SEND = """
import sys
sys.path.insert(0, sys.argv[1])
from test_garbage import send
send(sys.argv[2], int(sys.argv[3]))
"""


def garbage(rng: np.random.Generator) -> Iterator[bytes]:
    """Packets that are no DDSI, that begin as such, and that hold one malformed submessage."""
    begin = b"RTPS\x02\x01\x01\x10"
    while True:
        body = rng.bytes(4 * int(rng.integers(1, 50)))
        yield body
        yield b"RTPS" + body
        yield begin + rng.bytes(12) + b"\x15\x05" + struct.pack("<H", len(body)) + body
        kind = int(rng.choice([6, 7, 8, 9, 0x12, 0x13, 0x16]))
        yield begin + rng.bytes(12) + bytes([kind]) + body


def send(host: str, port: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for k, packet in zip(range(PACKETS), garbage(np.random.default_rng(1)), strict=False):
            sock.sendto(packet, (host, port + k % 2))
            if k % 50 == 49:
                time.sleep(2e-3)  # or the kernel drops them before anyone looks


@dataclass
class Listener:
    """A process that takes part in the domain over ``lo``; `errors` is what it wrote to stderr."""

    process: "subprocess.Popen[str]"
    errors: Path

    def dropped(self) -> int:
        """How many datagrams the kernel kept from its sockets."""
        rows = Path(f"/proc/{self.process.pid}/net/udp").read_text(encoding="ascii").splitlines()[1:]
        ports = (f"00000000:{PORT:04X}", f"00000000:{PORT + 1:04X}")
        return sum(int(row.split()[-1]) for row in rows if row.split()[1] in ports)

    def outcome(self) -> tuple[int, int]:
        """How many of 200 poses it received, and by how many bytes it grew."""
        assert self.process.stdin
        assert self.process.stdout
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        received, grown = map(int, self.process.stdout.readline().split())
        return received, grown


@contextmanager
def listener(errors: Path, *before: str) -> Generator[Listener]:
    pipe = subprocess.PIPE
    command = [*before, sys.executable, "-c", LISTEN]
    with (
        errors.open("w") as file,
        subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=file, text=True) as process,
    ):
        try:
            assert process.stdout
            assert process.stdout.readline() == "ready\n"
            yield Listener(process, errors)
        finally:
            process.communicate(timeout=60)


def test_garbage_from_this_machine_is_not_logged_and_takes_no_memory(tmp_path: Path) -> None:
    with listener(tmp_path / "errors") as here:
        send("127.0.0.1", PORT)
        received, grown = here.outcome()
    assert received == 200
    assert grown < GROWTH
    assert (tmp_path / "errors").stat().st_size < LOGGED


def test_what_comes_from_another_network_does_not_get_in(networks: Networks, tmp_path: Path) -> None:
    with listener(tmp_path / "errors", *networks.near) as here:
        command = [sys.executable, "-c", SEND, str(Path(__file__).parent), networks.address, str(PORT)]
        subprocess.run([*networks.far, *command], check=True)
        dropped = here.dropped()
        received, grown = here.outcome()
    assert dropped >= PACKETS
    assert received == 200
    assert grown < GROWTH
    assert (tmp_path / "errors").stat().st_size < LOGGED
