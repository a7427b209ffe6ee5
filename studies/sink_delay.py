"""The live loop with every sink open: delay from a window to its received message.

Prints its table in two minutes: ``python -m studies.sink_delay``. It needs jackd and, for rclpy, `make ros`.
"""

import json
import math
import os
import pty
import shutil
import socket
import subprocess
import sys
import tempfile
import termios
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from msgspec import Meta
from studies._command import measure

from monochord import VirtualSensor
from monochord.benchmarks import resident
from monochord.benchmarks.base import Benchmark, Row, row
from monochord.capture.jack.server import JackServer
from monochord.core.errors import DeviceError, InputError
from monochord.core.priority import before_other_programs
from monochord.core.types import Audio
from monochord.core.units import FINITE, Samples, Seconds
from monochord.lab.player import PlayerSettings, write_script
from monochord.live import LiveRun, Summary, WindowSettings, run
from monochord.live.sinks.base import Listener, Update

RATE = 44100
TAKE: Seconds = 30.0
"""The sound, repeated: ten touches, half of which slide."""
ALONE: Seconds = 20.0
"""Longest baseline run, without sinks, in s."""
SETTLED = 0.2
"""Share of a run from which memory is compared with its end."""
BOUND: Seconds = 0.01
"""Delay from a window's last sample at the converter to the received message."""
LOOP_BOUND: Seconds = 0.003
"""Delay from a window's last sample being available to its estimates."""
NAMESPACE, DOMAIN = "monochord_bench", 77
SCREEN = 40, 120
"""Lines and columns of the simulated terminal."""
SUBSCRIBER = Path(__file__).with_name("_subscriber.py")
HEADLESS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
    "--window-size=1280,800",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Sinks(Benchmark):
    """Delays from a window's last sample with every sink open, beside the loop alone.

    The simulated sensor is touched and slid over; a process plays it into the benchmark's JACK server with
    the dummy driver. The bundled model estimates. The view is drawn on a hidden terminal, files are written,
    the page is served, messages are sent over UDP and DDS, and another process receives the wrenches: rclpy
    where ``python`` names an interpreter with it (or ``$MONOCHORD_ROS_PYTHON``, or ``.venv-ros`` in the
    current folder), else Monochord's participant. The delay is from the last sample at the converter to the
    received message, both on the system clock, plus one period, by which a sound card's driver is later than
    the dummy driver.

    Parameters
    ----------
    seconds
        Duration of the run with sinks.
    period
        JACK period in frames.
    hop
        Hop in seconds.
    python
        Interpreter with rclpy.
    browser
        A Chromium that opens the page, for instance ``chromium``; empty for none.
    real_time
        Whether everything except the browser has real-time priority: server, player, loop, sinks, and
        subscriber.
    """

    seconds: Annotated[Seconds, Meta(ge=5.0, le=FINITE)] = 60.0
    period: Samples = 64
    hop: Seconds = 0.01
    python: str = ""
    browser: str = ""
    real_time: bool = False

    @property
    def due(self) -> int:
        """Windows that end within the run, each either estimated or counted as skipped."""
        size, hop = WindowSettings(hop=self.hop).frames(RATE)
        return (round(self.seconds * RATE) - size) // hop + 1

    def run(self) -> Iterator[Row]:
        """Time the loop alone, then with every sink."""
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            if self.real_time:
                stack.enter_context(before_other_programs())
            server = stack.enter_context(JackServer(period=self.period))
            ports = stack.enter_context(_playing(folder, server.name, self.seconds))
            alone = self._run(ports, server.name, min(ALONE, 0.5 * self.seconds))
            python, ros = _interpreter(self.python)
            messages = stack.enter_context(_Subscriber(python))
            memory = _Memory(settled=SETTLED * self.seconds)
            page = f"127.0.0.1:{_free_port()}"
            sinks: dict[str, dict[str, object]] = {
                "csv": {"path": str(folder / "live.csv")},
                "jsonl": {"path": str(folder / "live.jsonl")},
                "mcap": {"path": str(folder / "live.mcap")},
                "ros2": {"namespace": NAMESPACE, "domain": DOMAIN},
                "terminal": {"stderr": True},
                "udp": {},
                "web": {"at": page, "stderr": True},
            }
            if self.browser:
                stack.enter_context(_browser(self.browser, f"http://{page}/", folder))
            with _terminal():
                summary = self._run(ports, server.name, self.seconds, sinks, memory)
            delays = 1e3 * (np.array(messages.delays()) + self.period / RATE)
        yield row("windows estimated", summary.windows, "1", "due", self.due)
        yield row("windows skipped", summary.skipped, "1", "due", self.due)
        yield row("frames dropped", summary.health.dropped, "1")
        yield row("xruns, which put JACK's times off", summary.health.xruns, "1")
        for percentile in ("p50", "p95", "p99"):
            own, other = (1e3 * getattr(each.stages["latency"], percentile) for each in (summary, alone))
            yield row(f"loop {percentile}", own, "ms", "the loop without sinks", other)
        yield row("the same p99", 1e3 * summary.stages["latency"].p99, "ms", "bound", 1e3 * LOOP_BOUND)
        captured = alone.stages["capture"]
        receiver = "rclpy" if ros else "DDS"
        for share, percentile in ((0.5, "p50"), (0.95, "p95"), (0.99, "p99")):
            value = float(np.quantile(delays, share)) if delays.size else math.nan
            other = 1e3 * (getattr(captured, percentile) + self.period / RATE)
            yield row(f"converter to {receiver} {percentile}", value, "ms", "converter to estimate", other)
        if delays.size:
            yield row("the same p99", float(np.quantile(delays, 0.99)), "ms", "bound", 1e3 * BOUND)
        yield row("wrenches received", float(delays.size), "1", "windows", summary.windows)
        for each in summary.delivered:
            yield row(f"left out by {each.sink}", each.left_out, "1", "windows", summary.windows)
        grown = 100.0 * (memory.now - memory.megabytes) / memory.megabytes
        yield row("memory growth", grown, "%")
        yield row("resident at the end", memory.now, "MB", "after a fifth", memory.megabytes)

    def _run(
        self,
        ports: list[str],
        server: str,
        seconds: Seconds,
        sinks: dict[str, dict[str, object]] | None = None,
        *listeners: Listener,
    ) -> Summary:
        tree = {
            "source": {"name": "jack", "ports": ",".join(ports), "server": server},
            "estimator": {"name": "model", "path": "demo"},
            "window": {"hop": self.hop},
            "sinks": sinks or {},
            "seconds": seconds,
            "real_time": self.real_time,
        }
        setup = LiveRun.read(tree)
        summary = run(replace(setup, sinks=(*setup.sinks, *listeners)))
        if summary.interrupted:
            raise KeyboardInterrupt  # part of a run is no measurement
        return summary


class _Memory(Listener):
    """Records the resident memory once the loop has settled, and at the last window."""

    def __init__(self, settled: Seconds) -> None:
        self._settled = settled
        self.megabytes = self.now = math.nan

    def write(self, update: Update) -> None:
        if update.prediction.time >= self._settled and update.prediction.start % RATE < 441:
            self.now = resident()
            if math.isnan(self.megabytes):
                self.megabytes = self.now


class _Subscriber:
    """A process that receives wrenches and finally reports their delays."""

    def __init__(self, python: str) -> None:
        self._command = [python, str(SUBSCRIBER), NAMESPACE]

    def __enter__(self) -> Self:
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(DOMAIN),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        }
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(  # noqa: S603  (the Python that the user named)  # nosec B603
            self._command, stdin=pipe, stdout=pipe, text=True, env=environment
        )
        if self._process.stdout is None or self._process.stdout.readline() != "ready\n":
            self._process.kill()
            raise DeviceError(f"subscriber {' '.join(self._command)}: did not start")
        return self

    def delays(self) -> list[Seconds]:
        """End the process, and return its delays."""
        return json.loads(self._process.communicate(timeout=30)[0])

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()


@contextmanager
def _playing(folder: Path, server: str, seconds: Seconds) -> Generator[list[str]]:
    """Play the simulated sensor repeatedly in a process; yields its ports."""
    script = folder / "sound.npz"
    repeat = math.ceil((seconds + ALONE + 30.0) / TAKE)
    write_script(script, {"samples": _touched()}, PlayerSettings(server=server, repeat=repeat))
    command = [sys.executable, "-m", "monochord.lab.player", str(script)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:  # noqa: S603  (our own module)  # nosec B603
        if process.stdin is None or process.stdout is None or not (line := process.stdout.readline()):
            raise DeviceError("the benchmark's player did not start")
        try:
            process.stdin.write(f"{time.monotonic() + 1.0}\n")
            process.stdin.flush()
            yield json.loads(line)["ports"]
        finally:
            process.stdin.close()


def _touched() -> Audio:
    """Return the sound of touches, (2, n)."""
    random, twin, parts = np.random.default_rng(5), VirtualSensor("prototype", seed=5), []
    for number in range(round(TAKE / 3.0)):
        parts.append(twin.advance(1.0)[0])
        place = random.uniform(0.05, 0.13)
        twin.press(place, random.uniform(0.3, 1.8))
        parts.append(twin.advance(0.6)[0])
        if number % 2:
            twin.slide(1.0, along=0.01)
        parts.append(twin.advance(1.4)[0])
        twin.release()
    return np.concatenate(parts, axis=1).astype(np.float32)


@contextmanager
def _terminal() -> Generator[None]:
    """Make standard error a hidden terminal."""
    leader, follower = pty.openpty()
    termios.tcsetwinsize(leader, SCREEN)

    def look() -> None:
        with suppress(OSError):  # no terminal any more
            while os.read(leader, 65536):
                pass

    looking = threading.Thread(target=look, daemon=True)
    looking.start()
    try:
        with os.fdopen(follower, "w", encoding="utf-8") as screen, redirect_stderr(screen):
            yield
    finally:
        looking.join()
        os.close(leader)


@contextmanager
def _browser(binary: str, url: str, folder: Path) -> Generator[None]:
    """Open the page in a headless Chromium."""
    command = [shutil.which(binary) or binary, *HEADLESS, f"--user-data-dir={folder / 'browser'}", url]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet) as process:  # noqa: S603  (found in PATH)  # nosec B603
        os.sched_setscheduler(process.pid, os.SCHED_OTHER, os.sched_param(0))  # a page may wait
        yield
        process.terminate()


def _interpreter(given: str) -> tuple[str, bool]:
    """Return the subscriber's interpreter, and whether it has rclpy."""
    named = given or os.environ.get("MONOCHORD_ROS_PYTHON", "") or str(Path(".venv-ros", "bin", "python"))
    if Path(named).is_file():
        return named, True
    if given:
        raise InputError(
            f"python {given} (does not exist)", "an interpreter with rclpy", "create one with: make ros"
        )
    return sys.executable, False


def _free_port() -> int:
    with socket.socket() as own:
        own.bind(("127.0.0.1", 0))
        return own.getsockname()[1]


if __name__ == "__main__":
    measure(Sinks)
