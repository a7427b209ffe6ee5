"""The live command on a real JACK server into which a simulated sensor is played, read as it goes on."""

import csv
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from io import SEEK_END
from pathlib import Path
from signal import SIGTERM
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.waiting import wait_for

from monochord.capture.sources import SOURCES

RATE = 44100
POSITION = 0.08
Row = dict[str, str]


@dataclass
class Live:
    """A running `monochord live`, whose sink `csv` is read as it grows."""

    process: "subprocess.Popen[str]"
    table: Path
    summary: str = ""
    shown: str = ""

    def rows(self) -> list[Row]:
        """Return the windows so far."""
        return read(self.table.read_text(encoding="utf-8"))

    def wait_for(self, condition: Callable[[Row], object]) -> Row:
        """Return the first window from now on for which a condition holds."""
        wait_for(lambda: self.runs() and self.table.exists() and self.table.stat().st_size)
        with self.table.open(encoding="utf-8") as file:
            head, text, found = file.readline(), "", list[Row]()
            file.seek(0, SEEK_END)
            file.readline()

            def look() -> bool:
                nonlocal text
                self.runs()
                whole, _, text = (text + file.read()).rpartition("\n")
                found.extend(filter(condition, read(f"{head}{whole}\n")))
                return bool(found)

            wait_for(look)
        return found[0]

    def runs(self) -> bool:
        """Fail with what it said where it has ended."""
        assert self.process.poll() is None, self.process.communicate()
        return True

    def wait_for_touch(self) -> None:
        """Wait until the touch is estimated where it is."""
        self.wait_for(touched)

    def wait_for_note(self, key: str) -> Row:
        """Wait until something is said of the sensor's health."""
        return self.wait_for(lambda row: key in notes(row))

    def end(self, status: int = 0) -> None:
        """End it as a service manager does."""
        self.process.send_signal(SIGTERM)
        self.summary, self.shown = self.process.communicate(timeout=60)
        assert self.process.returncode == status, self.shown
        assert "Traceback" not in self.shown
        assert self.counted("windows") == len(self.rows())

    def counted(self, name: str) -> int:
        """Return a count of the summary."""
        match = re.search(rf"\b{name} (\d+)", self.summary)
        assert match, self.summary
        return int(match[1])


def read(text: str) -> list[Row]:
    """Return the whole lines of a table."""
    return list(csv.DictReader(text.rpartition("\n")[0].splitlines()))


def notes(row: Row) -> list[str]:
    """Return what is said of the sensor's health with a window."""
    return row["notes"].split()


def touched(row: Row) -> bool:
    """Return whether the touch is estimated where it is."""
    return bool(row["position"]) and abs(float(row["position"]) - POSITION) < 5e-3


StartLive = Callable[..., Live]


@pytest.fixture
def start_live(jack_server: Any, tmp_path: Path) -> Iterator[StartLive]:
    """Return what starts the live command with the bundled model and more options."""
    with ExitStack() as stack:

        def start(*options: str, table: Path = tmp_path / "live.csv", **more: Any) -> Live:
            command = [sys.executable, "-m", "monochord", "live", "demo", "player:", "--source", "jack"]
            command += ["--set", f"source.server={jack_server.name}", "--sink", f"csv={table}", *options]
            pipe = subprocess.PIPE
            process = stack.enter_context(
                subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, **more)
            )
            stack.callback(process.kill)
            return Live(process, table)

        yield start


def sounding(seconds: float, start: float = 1.5, **options: Any) -> np.ndarray:
    """Return so many seconds of a simulated sensor, (2, n), touched from `start` on."""
    touch = {"start": start, "position": POSITION, "force": 1.0}
    with SOURCES.build(
        "twin", {"script": [touch], "speed": 0.0, "duration": seconds, **options}
    ).open() as twin:
        return np.concatenate([block.samples for block in twin], axis=1)


@pytest.fixture(scope="session")
def touch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of a minute with a touch that stays."""
    path = tmp_path_factory.mktemp("tape") / "touch.wav"
    soundfile.write(path, sounding(60.0).T, RATE, subtype="FLOAT")
    return path
