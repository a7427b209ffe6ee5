"""Settings for all tests; and a real JACK server of the test's own, with a process that plays into it."""

import fcntl
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hypothesis import settings

from monochord import realstrings
from monochord.errors import DeviceError

# A time limit for each example fails on a machine that is busy, and says nothing of the code.
settings.register_profile("monochord", deadline=None)
settings.load_profile("monochord")

RATE = 44100
SERVERS = 4  # JACK's registry has room for eight on a machine


@contextmanager
def own_name() -> Generator[str]:
    """A server name that no other run uses now; taken again later, it clears away what a kill left behind."""
    with ExitStack() as stack:
        for slot in range(SERVERS):
            path = Path(tempfile.gettempdir(), f"monochord-jack-{slot}.lock")
            lock = stack.enter_context(path.open("w", encoding="ascii"))
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield f"monochord-test-{slot}"
            return
        pytest.fail(f"{SERVERS} runs of these tests have a JACK server each; wait for one to end")


@dataclass
class JackServer:
    """A jackd of ours: dummy driver, synchronous, so that it loses no frame of its own."""

    name: str
    period: int = 512
    rate: int = RATE
    process: "subprocess.Popen[bytes] | None" = None

    def start(self) -> None:
        from monochord.realtime.client import JackClient

        options = ["-n", self.name, "-S", "-r", "-d", "dummy", "-r", str(self.rate), "-p", str(self.period)]
        quiet = subprocess.DEVNULL
        self.process = subprocess.Popen(["jackd", *options], stdin=quiet, stdout=quiet, stderr=quiet)
        deadline = time.monotonic() + 20.0
        while True:
            try:
                return JackClient("probe", self.name).close()
            except DeviceError:
                assert time.monotonic() < deadline, "jackd did not start"
                assert self.process.poll() is None, "jackd ended"
                time.sleep(0.02)

    def kill(self) -> None:
        """Kill -9, as a crash would."""
        if self.process:
            self.process.kill()
            self.process.wait()
            self.process = None

    def stop(self) -> None:
        """End it as a person would, so that it tidies up."""
        if self.process:
            self.process.terminate()
            self.process.wait(20)
            self.process = None

    def restart(self, rate: int = RATE) -> None:
        self.kill()
        self.rate = rate
        self.start()


@contextmanager
def own_server(period: int = 512) -> Generator[JackServer]:
    """A running server of the test's own; the test is skipped where none can be started."""
    if not shutil.which("jackd"):
        pytest.skip("jackd is not installed (Debian: apt install jackd2)")
    with own_name() as name:
        server = JackServer(name, period=period)
        server.start()
        yield server
        server.stop()


@pytest.fixture
def jack_server(request: pytest.FixtureRequest) -> Iterator[JackServer]:
    """A running server; parametrise indirectly with the frames a period."""
    with own_server(getattr(request, "param", 512)) as server:
        yield server


Play = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def play(jack_server: JackServer) -> Iterator[Play]:
    """Return the function that starts a process playing a file, which begins once it is connected.

    Its ports are ``player:out_1`` and, for two channels, ``player:out_2``. Terminate it to take them away.
    """
    started: list[subprocess.Popen[str]] = []

    def start(file: Path, name: str = "player") -> "subprocess.Popen[str]":
        script = Path(__file__).with_name("play_file.py")
        command = [sys.executable, str(script), str(file), jack_server.name, name]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        started.append(process)
        assert process.stdout
        assert process.stdout.readline() == "ready\n"
        return process

    yield start
    jack_server.stop()  # players end with their server
    for process in started:
        assert process.stdout
        process.stdout.close()
        process.wait(20)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A second and a half of two microphones on a real string where there is one, else of stiff partials."""
    file, frames = tmp_path / "recording.wav", 3 * RATE // 2
    folder = realstrings.folder()
    real = sorted(folder.glob("shiny_2ch/*.flac")) if folder else []
    if real:
        both = soundfile.read(real[0], frames, dtype="float32", always_2d=True)[0]
    else:
        t, rng = np.arange(frames) / RATE, np.random.default_rng(0)
        partials = [n * 196.0 * np.sqrt(1 + 1e-4 * n * n) for n in range(1, 16)]
        sound = sum(np.sin(2 * np.pi * f * t) * np.exp(-f * t / 200) / 15 for f in partials)
        both = np.stack([sound, 0.7 * sound], axis=1) + 1e-3 * rng.standard_normal((frames, 2))
    soundfile.write(file, both, RATE, subtype="FLOAT")
    return file
