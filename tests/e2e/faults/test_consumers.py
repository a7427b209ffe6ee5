"""Those who take estimates stop, die or run out of space: the loop and the others go on, and it is said."""

import http.client
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.e2e.conftest import HOUR, ClockToSet
from tests.e2e.faults.conftest import RATE, Live, StartLive, notes, touched
from tests.e2e.test_ros import DOMAIN, rclpy_node
from tests.live.web.test_server import free
from tests.waiting import wait_for

from monochord.sessions import check, read_session

pytestmark = [pytest.mark.jack, pytest.mark.slow]
HOP = 0.01
READER = "import sys\nfor line in sys.stdin: pass"


def whole(live: Live) -> None:
    """Assert that each window is there or was counted as skipped, and that the touch is estimated at last."""
    times = [float(row["time"]) for row in live.rows()]
    assert sum(round((b - a) / HOP) - 1 for a, b in pairwise(times)) <= live.counted("skipped")
    assert touched(live.rows()[-1])


def later(live: Live, windows: int = 200) -> None:
    """Wait until so many windows more are written."""
    count = len(live.rows()) + windows
    wait_for(lambda: len(live.rows()) >= count)


def left_out(live: Live, sink: str) -> int:
    """Return how many windows a sink did not get, by the summary."""
    lines = [line for line in live.summary.splitlines() if line.startswith("sink") and f" {sink} " in line]
    return int(lines[0].split(" left out")[0].split()[-1]) if lines else 0


def test_a_consumer_that_pauses_for_two_seconds_misses_nothing(
    play: Any, touch: Path, start_live: StartLive
) -> None:
    play(touch)
    with subprocess.Popen([sys.executable, "-c", READER], stdin=subprocess.PIPE) as consumer:
        assert consumer.stdin
        live = start_live(
            "--sink", f"jsonl=/dev/fd/{consumer.stdin.fileno()}", pass_fds=[consumer.stdin.fileno()]
        )
        consumer.stdin.close()
        live.wait_for_touch()
        consumer.send_signal(signal.SIGSTOP)
        time.sleep(2.0)
        consumer.send_signal(signal.SIGCONT)
        later(live)
        live.end()
    whole(live)
    assert left_out(live, "jsonl") == 0


def test_a_disk_that_fills_up_ends_the_recording_alone(
    play: Any, touch: Path, start_live: StartLive, small_disk: Path
) -> None:
    play(touch)
    take = small_disk / "take.mcap"
    live = start_live("--sink", f"mcap={take}")
    live.wait_for_touch()
    free = os.statvfs(small_disk)
    (small_disk / "filler").write_bytes(bytes(free.f_bavail * free.f_frsize))
    live.wait_for_note("mcap_closed")
    later(live)
    live.end(1)
    whole(live)
    assert "mcap" in live.shown
    report = check(take)
    assert report.sound, report.faults
    assert read_session(take).audio.samples.shape[1] > RATE


def test_a_ros_subscriber_that_is_killed_costs_nothing_and_the_next_one_hears(
    play: Any, touch: Path, start_live: StartLive
) -> None:
    play(touch)
    live = start_live("--sink", "ros2=/sensor", "--set", f"sinks.ros2.domain={DOMAIN}")
    live.wait_for_touch()
    with rclpy_node("ros_subscriber.py", "100000") as first:
        assert first.stdout
        assert first.stdout.readline() == "ready\n"
        later(live)
        first.kill()
    later(live)
    with rclpy_node("ros_subscriber.py", "50") as second:
        assert second.stdout
        assert second.stdout.readline() == "ready\n"
        assert '"wrench": [["string"' in second.stdout.readline()
    live.end()
    whole(live)


def test_a_clock_that_is_set_is_said_and_the_times_go_on(
    play: Any, touch: Path, start_live: StartLive, clock_to_set: ClockToSet, tmp_path: Path
) -> None:
    play(touch)
    take = tmp_path / "take.mcap"
    live = start_live("--sink", f"mcap={take}", env=clock_to_set.environment)
    live.wait_for_touch()
    clock_to_set.set()
    live.wait_for_note("clock_set")
    later(live)
    live.end()
    whole(live)
    times, stamps = (np.array([float(row[name]) for row in live.rows()]) for name in ("time", "stamp"))
    assert np.diff(times).min() > 0.0
    ahead = stamps - times
    (jump,) = np.flatnonzero(np.abs(np.diff(ahead)) > 60.0)
    assert ahead[jump + 1] - ahead[jump] == pytest.approx(HOUR, abs=0.5)
    assert np.ptp(ahead[: jump + 1]) < 0.5
    assert np.ptp(ahead[jump + 1 :]) < 0.5
    noted = [number for number, row in enumerate(live.rows()) if "clock_set" in notes(row)]
    assert jump < noted[0] < jump + 300
    # A session runs on the monotonic clock from its first window on.
    recorded = read_session(take).readings("estimates").time
    assert np.diff(recorded).min() > 0.0
    assert np.ptp(recorded) == pytest.approx(np.ptp(times), abs=0.5)


def test_a_service_manager_ends_it_with_every_sink_whole(
    play: Any, touch: Path, start_live: StartLive, tmp_path: Path
) -> None:
    play(touch)
    take, lines = tmp_path / "take.mcap", tmp_path / "take.jsonl"
    sinks = [f"mcap={take}", f"jsonl={lines}", "udp=127.0.0.1:47899", "ros2=/sensor", "web"]
    live = start_live(*(f"--sink={sink}" for sink in sinks), "--set", f"sinks.ros2.domain={DOMAIN}")
    live.wait_for_touch()
    later(live)
    begun = time.monotonic()
    live.end()
    assert time.monotonic() - begun < 10.0
    whole(live)
    windows = live.counted("windows")
    report = check(take)
    assert report.sound, report.faults
    assert read_session(take).complete
    assert windows - left_out(live, "jsonl") == lines.read_text(encoding="utf-8").count("\n")
    assert windows - left_out(live, "mcap") == len(read_session(take).readings("estimates").time)


def never_reading(stack: ExitStack, port: int) -> socket.socket:
    """Return a connection to the page's WebSocket that takes as little as its smallest buffer holds."""
    request = f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\n"
    request += "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    request += "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    client = stack.enter_context(socket.socket())
    client.settimeout(30.0)
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    client.connect(("127.0.0.1", port))
    client.sendall(request.encode())
    return client


def test_browsers_that_never_read_delay_nothing(play: Any, touch: Path, start_live: StartLive) -> None:
    play(touch)
    port = free()
    live = start_live("--sink", f"web=127.0.0.1:{port}")
    live.wait_for_touch()
    with ExitStack() as stack:
        for client in [never_reading(stack, port) for _ in range(200)]:
            assert client.recv(12) == b"HTTP/1.1 101"
        later(live, 1000)
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30.0)
        connection.request("GET", "/")
        assert connection.getresponse().status == 200
        connection.close()
    live.end()
    whole(live)
    assert left_out(live, "web") == 0
    assert not any("web_closed" in notes(row) for row in live.rows())
