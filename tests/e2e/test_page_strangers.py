"""A run that is watched and recorded goes on whoever else connects to its page."""

import http.client
import json
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from websockets.sync.client import ClientConnection, connect

from monochord.capture.jack.machine import OK, priority
from monochord.sessions import read_session

pytestmark = [pytest.mark.slow, pytest.mark.real_time, pytest.mark.timeout(300)]
RATE, COUNT, SECONDS = 44100, 1100, 15.0
COOKIE = {"Cookie": "monochord=secret"}
STRANGERS = Path(__file__).with_name("strangers.py")
TWIN = ["demo", "--source", "twin"]
# What is measured is what strangers do to the run, not what other programs on this machine do to it.
FIRST = ["--real-time"] if priority().state == OK else []


@contextmanager
def watched(folder: Path, *source: str) -> Generator[tuple[ClientConnection, int]]:
    """Run live with a page and a session, allowed 1024 files, and return the page's client and its port."""
    sinks = ["--sink", "web=0.0.0.0:0", "--sink", "mcap=all.mcap", "--set", "sinks.web.token=secret"]
    command = [sys.executable, "-m", "monochord", "live", *source, *FIRST, *sinks]
    limited = ["sh", "-c", 'ulimit -Sn 1024; exec "$@"', "sh", *command]
    errors = folder / "errors.txt"
    with (
        errors.open("wb") as file,
        subprocess.Popen(limited, cwd=folder, stdout=subprocess.PIPE, stderr=file, text=True) as process,
    ):
        try:
            assert process.stdout
            port = int(process.stdout.readline().partition("/?")[0].rpartition(":")[2])
            with connect(
                f"ws://127.0.0.1:{port}/live", additional_headers=COOKIE, open_timeout=30, max_queue=None
            ) as page:
                shown(page)
                yield page, port
            process.terminate()
            process.communicate(timeout=60)
            assert process.returncode == 0
        finally:
            process.kill()  # of a test that failed
    assert errors.stat().st_size < 1000, errors.read_bytes()[:2000]


def shown(page: ClientConnection, seconds: float = 0.0) -> dict[str, Any]:
    """Return the newest of the moments that a page is shown for some seconds, at least one."""
    moment, begin = dict[str, Any](), time.monotonic()
    while not moment or time.monotonic() < begin + seconds:
        content = page.recv(60)
        if isinstance(content, str) and (message := json.loads(content))["type"] == "moment":
            moment = message
    return moment


def answered(port: int) -> float:
    """Return in how many seconds the page is answered to who has the token."""
    begin = time.monotonic()
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    connection.request("GET", "/", headers=COOKIE)
    answer = connection.getresponse()
    assert answer.status == 200
    assert answer.read()
    connection.close()
    return time.monotonic() - begin


def besieged(folder: Path, again: list[str], *source: str) -> list[float]:
    """Record from the page while strangers are connected, and return in how many seconds it was answered."""
    with watched(folder, *source) as (page, port):
        shown(page, 2.0)
        before = shown(page)
        command = [sys.executable, str(STRANGERS), str(port), str(COUNT), str(SECONDS + 2.0), *again]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as strangers:
            shown(page, 2.0)
            begin = time.monotonic()
            page.send('{"do":"record","on":true}')
            times, newest = list[float](), before
            while time.monotonic() < begin + SECONDS - 2.0:
                times.append(answered(port))
                newest = shown(page, 0.5)
            page.send('{"do":"record","on":false}')
            passed = time.monotonic() - begin
            assert newest["server"]["clients"] == 1
            saved = shown(page, 2.0)["tasks"]["saved"]
            count, _ = strangers.communicate(timeout=60)
        assert int(count) >= COUNT
        assert newest["health"]["dropped"] == before["health"]["dropped"] == 0
    (file,) = folder.glob("live_*.mcap")
    assert str(file) in saved
    session = read_session(file)
    assert session.complete
    assert session.audio.gaps == ()
    assert session.audio.samples.shape[1] / RATE == pytest.approx(passed, abs=1.0)
    assert read_session(folder / "all.mcap").complete
    return times


@pytest.mark.parametrize("again", [[], ["again"]], ids=["idle", "returning"])
def test_the_twin_is_recorded_and_watched_while_strangers_are_connected(
    tmp_path: Path, again: list[str]
) -> None:
    times = besieged(tmp_path, again, *TWIN)
    assert max(times) < (4.0 if again else 1.0), times


@pytest.mark.jack
def test_jack_is_recorded_and_watched_while_strangers_are_connected(
    tmp_path: Path, jack_server: Any, play: Any
) -> None:
    t = np.arange(60 * RATE) / RATE
    note = sum(0.1 / n * np.sin(2 * np.pi * 130.8 * n * t) for n in range(1, 6))
    soundfile.write(tmp_path / "note.wav", np.stack([note, note], axis=1), RATE, subtype="FLOAT")
    play(tmp_path / "note.wav")
    source = ["player:", "--source", "jack", "--set", f"source.server={jack_server.name}"]
    times = besieged(tmp_path, [], *source, "--length", "0.65", "--open-frequency", "110")
    assert max(times) < 1.0, times
