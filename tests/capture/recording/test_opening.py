"""`monochord record` interrupted while its devices are being opened: at once, and nothing is left behind."""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.capture.instruments.test_opening import serving, trickle

MONOCHORD = str(Path(sys.executable).with_name("monochord"))


@pytest.fixture
def slow_box() -> Iterator[tuple[int, threading.Event]]:
    """A Net F/T whose settings come byte by byte: its port, and an event once it is asked."""
    requested = threading.Event()

    def reply() -> Iterator[bytes]:
        requested.set()
        yield from trickle(b"HTTP/1.1 200 OK\r\n\r\n<netft>")

    with serving(reply) as port:
        yield port, requested


def interrupted(process: "subprocess.Popen[str]", number: signal.Signals) -> None:
    """Send the signal, once, and see the process end as the command line has it, with nothing to explain."""
    time.sleep(0.2)
    assert process.poll() is None
    process.send_signal(number)
    try:
        printed, shown = process.communicate(timeout=45)  # the devices would take a minute
    finally:
        process.kill()
    assert process.returncode == 130
    assert printed == ""
    assert len(shown.splitlines()) == 1


def start(*words: str, **more: Any) -> "subprocess.Popen[str]":
    pipe = subprocess.PIPE
    return subprocess.Popen([MONOCHORD, "record", *words], stdout=pipe, stderr=pipe, text=True, **more)


def test_a_device_that_trickles(tmp_path: Path, sound: Path, slow_box: tuple[int, threading.Event]) -> None:
    port, requested = slow_box
    folder = tmp_path / "takes"
    folder.mkdir()
    box = f"--instrument net_ft --set net_ft.http_port={port} --set net_ft.timeout_seconds=60".split()
    with start(
        str(folder / "take.mcap"), "--source", "wav", "--set", f"source.path={sound}", *box
    ) as process:
        assert requested.wait(30.0)
        interrupted(process, signal.SIGTERM)
    assert not list(folder.iterdir())


def test_a_jack_server_that_is_stuck(tmp_path: Path, jack_server: Any) -> None:
    folder = tmp_path / "takes"
    folder.mkdir()
    jack_server.process.send_signal(signal.SIGSTOP)
    try:
        with start(str(folder / "take.mcap"), "--set", f"source.server={jack_server.name}") as process:
            wait_until_blocked(process)
            interrupted(process, signal.SIGINT)
    finally:
        jack_server.process.send_signal(signal.SIGCONT)
    assert not list(folder.iterdir())


def wait_until_blocked(process: "subprocess.Popen[str]") -> None:
    """Wait until a process has done nothing for a second."""
    end, last = time.monotonic() + 60.0, (-1, 0.0)
    while time.monotonic() < end:
        times = Path(f"/proc/{process.pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        used = int(times[11]) + int(times[12])
        if used != last[0]:
            last = used, time.monotonic()
        elif used > 20 and time.monotonic() - last[1] > 1.0:
            return
        time.sleep(0.05)
    pytest.fail("it does not come to rest")
