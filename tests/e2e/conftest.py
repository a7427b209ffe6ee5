"""The recorder as a process of its own, and a force sensor as another."""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.sessions import disks

from monochord.lab.net_ft_device import NetFtSettings, write_script
from monochord.lab.pose_publisher import PublisherSettings

RATE = 44100
MONOCHORD = str(Path(sys.executable).with_name("monochord"))
DISK_SIZE = 9_000_000
HOUR = 3600.0
CLOCK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

/* The wall clock is an hour ahead once the file SET_CLOCK is there. */
int clock_gettime(clockid_t clock, struct timespec *time) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int failed = real(clock, time);
    const char *set = getenv("SET_CLOCK");
    if (!failed && clock == CLOCK_REALTIME && set && access(set, F_OK) == 0) time->tv_sec += 3600;
    return failed;
}
"""


@dataclass
class Recorder:
    """A running `monochord record`, which writes `out`."""

    out: Path
    process: "subprocess.Popen[str]"
    printed: str = field(default="", init=False)
    shown: str = field(default="", init=False)

    def wait_for(self, condition: Callable[[], Any]) -> None:
        deadline = time.monotonic() + 40.0
        while not condition():
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < deadline, "waited in vain"
            time.sleep(0.02)

    def wait_for_bytes(self, count: int) -> None:
        self.wait_for(lambda: self.out.exists() and self.out.stat().st_size >= count)

    def wait_for_more(self, count: int) -> None:
        self.wait_for_bytes(self.out.stat().st_size + count)

    def kill(self) -> float:
        """Kill -9; return when, in s of the monotonic clock."""
        self.process.kill()
        at = time.monotonic()
        self.process.communicate(timeout=20)
        return at

    def end(self, number: int | None = None) -> dict[str, Any]:
        """Send a signal, if any, and wait; return the summary that was printed."""
        if number is not None:
            self.process.send_signal(number)
        self.printed, self.shown = self.process.communicate(timeout=60)
        assert "Traceback" not in self.shown
        assert self.printed, self.shown
        return json.loads(self.printed)


StartRecorder = Callable[..., Recorder]


@pytest.fixture
def start_recorder(tmp_path: Path) -> Iterator[StartRecorder]:
    """Return what starts `monochord record` with some options, into a file of its own."""
    with ExitStack() as stack:

        def start(*options: str, out: Path | None = None, **more: Any) -> Recorder:
            out = out or tmp_path / f"take{len(list(tmp_path.glob('*.mcap')))}.mcap"
            command = [MONOCHORD, "record", str(out), "--json", *options]
            pipe = subprocess.PIPE
            process = stack.enter_context(
                subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True, **more
                )
            )
            stack.callback(process.kill)
            return Recorder(out, process)

        yield start


def paced(sound: Path, speed: int = 1) -> list[str]:
    """The options that record a file over and over, at some times the pace of real time."""
    sets = (f"source.path={sound}", f"source.speed={speed}", "source.repeat=0")
    return ["--source", "wav", *(word for assignment in sets for word in ("--set", assignment))]


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    """Two seconds of noise in two channels."""
    samples = np.random.default_rng(0).uniform(-0.5, 0.5, (2 * RATE, 2))
    soundfile.write(tmp_path / "sound.wav", samples, RATE, subtype="FLOAT")
    return tmp_path / "sound.wav"


@contextmanager
def playing(module: str, script: Path) -> Generator[dict[str, Any]]:
    """Start a device of the laboratory as a process of its own; give what it said of itself."""
    command = [sys.executable, "-m", f"monochord.lab.{module}", str(script)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdout
        assert process.stdin
        yield json.loads(process.stdout.readline())
        process.stdin.close()
        process.wait(20)


@pytest.fixture
def net_ft(tmp_path: Path) -> Iterator[list[str]]:
    """The options that record a force sensor of 7000 readings a second, which is a process of its own."""
    ramp = np.outer(np.arange(70_000) % 7000, [0.0, 0.0, 1e-3, 0.0, 0.0, 0.0])
    write_script(tmp_path / "load.npz", {"wrenches": ramp}, NetFtSettings())
    with playing("net_ft_device", tmp_path / "load.npz") as device:
        port = f"net_ft.http_port={device['http_port']}"
        # On a busy machine the device may pause, and would begin its stream anew if asked again meanwhile.
        patient = "net_ft.silence_seconds=5"
        yield ["--instrument", f"net_ft={device['address']}", "--set", port, "--set", patient]


@pytest.fixture
def pose_dds(tmp_path: Path) -> Iterator[list[str]]:
    """The options that record a pose of 250 a second over DDS, published by a process of its own."""
    pytest.importorskip("cyclonedds", reason="the extra ros is not installed")
    topic = f"/{tmp_path.name}_{os.getpid()}"
    poses = np.tile([0.1, 0.0, -0.001, 0.0, 0.0, 0.0, 1.0], (10, 1))
    settings = PublisherSettings(rate=250.0, topic=topic)
    write_script(tmp_path / "poses.npz", {"poses": poses}, settings)
    with playing("pose_publisher", tmp_path / "poses.npz"):
        yield ["--instrument", f"pose_dds={topic}", "--set", "pose_dds.rate=250"]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    with disks.small_disk(tmp_path / "disk", DISK_SIZE) as folder:
        yield folder


@dataclass
class ClockToSet:
    """The environment of a process whose wall clock `set` puts an hour ahead."""

    environment: dict[str, str]

    def set(self) -> None:
        Path(self.environment["SET_CLOCK"]).touch()


@pytest.fixture
def clock_to_set(tmp_path: Path) -> ClockToSet:
    if not shutil.which("gcc"):
        pytest.skip("gcc is not installed")
    source, library = tmp_path / "clock.c", tmp_path / "clock.so"
    source.write_text(CLOCK)
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    return ClockToSet({**os.environ, "LD_PRELOAD": str(library), "SET_CLOCK": str(tmp_path / "set")})
