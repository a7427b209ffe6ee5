"""Benchmark of the recorder: the cost of recording audio and force with a view, and constant memory."""

import io
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from monochord.benchmarks._process import resident
from monochord.benchmarks.base import Benchmark, Row, row
from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.instruments.base import Instrument
from monochord.capture.recording import RecordingJob, RecordingState, RecordingSummary, record
from monochord.capture.recording.view import viewed
from monochord.capture.sources import SOURCES
from monochord.core.screen import console_of
from monochord.core.units import FINITE, Hertz, Seconds
from monochord.lab.net_ft_device import NetFtSettings, write_script
from monochord.sessions import Event

RATE = 44100
BOUND = 25.0
"""Largest acceptable share of a core for a recorder, in per cent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording(Benchmark):
    """Processor time and memory of a recording: two microphones, then with a force sensor added.

    The microphones are a file in real time; the force sensor is a simulated Net F/T in a separate process,
    whose time is not counted; the view is drawn as in a terminal. The first fifth of each recording does not
    count.

    Parameters
    ----------
    seconds
        Duration of each recording.
    rate
        Force readings per second.
    block
        Frames per audio block.
    """

    seconds: Annotated[Seconds, Meta(ge=1.0, le=FINITE)] = 20.0
    rate: Hertz = 7000.0
    block: int = 256

    def run(self) -> Iterator[Row]:
        """Yield processor time and memory of both recordings, and the counts of readings."""
        with tempfile.TemporaryDirectory() as text:
            folder = Path(text)
            alone, _ = self._measured(folder / "alone.mcap", {})
            with _force_sensor(folder, self.rate) as instrument:
                both, summary = self._measured(folder / "both.mcap", {"net_ft": instrument})
        force = summary.instruments["net_ft"]
        yield Row(name="audio alone", value=alone.share, unit="% of a core")
        yield row("audio and force", both.share, "% of a core", "audio alone", alone.share)
        yield row("the same", both.share, "% of a core", "bound", BOUND)
        yield Row(name="memory growth", value=both.grown, unit="MB")
        yield row("readings a second", force.rate, "1/s", "due", self.rate)
        yield Row(name="readings missing", value=force.missing, unit="1")
        yield Row(name="frames dropped", value=summary.dropped, unit="1")
        yield Row(name="file", value=1e-6 * summary.size / summary.seconds, unit="MB/s")

    def _measured(self, path: Path, instruments: dict[str, Instrument]) -> tuple["_Meter", RecordingSummary]:
        sound = path.with_suffix(".wav")
        _write_noise(sound)
        options = {"path": str(sound), "speed": 1.0, "repeat": 0, "block": self.block}
        job = RecordingJob(
            path=path,
            source=SOURCES.build("wav", options),
            instruments=instruments,
            seconds=self.seconds,
        )
        meter = _Meter(settled=0.2 * self.seconds)
        shown = {"TERM": "xterm-256color", "COLUMNS": "100", "LINES": "30"}
        console = console_of(_Nowhere(), shown)
        with viewed(path, console) as view:

            def show(now: RecordingState, notices: Sequence[Event]) -> None:
                meter.look(now)
                view.show(now, notices)

            summary = record(job, show)
        if summary.interrupted:
            raise KeyboardInterrupt  # part of a run is no measurement
        return meter, summary


class _Meter:
    """Processor time and memory of this process, from a settled recording to its last update."""

    def __init__(self, settled: Seconds) -> None:
        self._settled = settled
        self._begin: tuple[Seconds, Seconds, float] | None = None
        self._now = (0.0, 0.0, 0.0)

    def look(self, now: RecordingState) -> None:
        self._now = (now.elapsed, time.process_time(), resident())
        if self._begin is None and now.elapsed >= self._settled:
            self._begin = self._now

    @property
    def share(self) -> float:
        """Processor time in per cent of one core."""
        begin = self._begin or self._now
        return 100.0 * (self._now[1] - begin[1]) / max(self._now[0] - begin[0], 1e-3)

    @property
    def grown(self) -> float:
        """Memory growth in MB."""
        return self._now[2] - (self._begin or self._now)[2]


class _Nowhere(io.StringIO):
    """A terminal whose pictures are discarded."""

    encoding = "utf-8"

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        return len(text)


@contextmanager
def _force_sensor(folder: Path, rate: Hertz) -> Generator[Instrument]:
    """Start a simulated force sensor, and return the instrument that reads it."""
    load = np.outer(np.sin(np.arange(70_000) / 500.0), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    script = folder / "load.npz"
    write_script(script, {"wrenches": load}, NetFtSettings(rate=rate))
    command = [sys.executable, "-m", "monochord.lab.net_ft_device", str(script)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:  # noqa: S603  (our own module)  # nosec B603
        if process.stdin is None or process.stdout is None:
            message = "the force sensor has no pipes"
            raise RuntimeError(message)
        try:
            yield INSTRUMENTS.build("net_ft", json.loads(process.stdout.readline()))
        finally:
            process.stdin.close()


def _write_noise(path: Path) -> None:
    import soundfile  # noqa: PLC0415

    noise = np.random.default_rng(0).uniform(-0.3, 0.3, (10 * RATE, 2)).astype(np.float32)
    soundfile.write(path, noise, RATE, subtype="FLOAT")
