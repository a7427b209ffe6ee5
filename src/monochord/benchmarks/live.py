"""Benchmark of the live loop: latency after a window's last sample, and constant memory."""

import dataclasses
import math
import tempfile
import time
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from monochord.benchmarks._process import one_core, resident
from monochord.benchmarks._take import write_take
from monochord.benchmarks.base import Benchmark, Row, row
from monochord.core.config import Tree
from monochord.core.ranges import NonNegative, Positive
from monochord.core.reasons import Reason
from monochord.core.timing import Histogram
from monochord.core.types import Estimate, Estimates, Prediction
from monochord.core.units import FINITE, Seconds
from monochord.live import LiveRun, Summary, run
from monochord.live.filter import FilterSettings, FilterState, step
from monochord.live.sinks.base import Listener, Update
from monochord.physics.strings import load_string

RATE = 44100
TAKE: Seconds = 10.0  # of audio, played over and over
AUTOCORRELATION = "FFT autocorrelation of the same window"
ESTIMATE = "estimate of a window, closed form"
FILTERED = 6000
"""Duration of the filter timing in windows: a minute."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Live(Benchmark):
    """Latency and memory of the live loop on one core, with a synthetic stiff string read from a file.

    Latency is the time from a window's last sample being available to its estimate, in real time; the
    baseline is the FFT autocorrelation of the same windows, timed in the same loop. The two-sided form is
    timed on the simulated sensor, with intermittent touches. The filter over time is timed on synthetic
    touches with all four quantities. Memory is the resident set after the first minute of audio and at the
    end. The study `sink_delay` times a trained model and every sink.

    Parameters
    ----------
    seconds
        Duration of the audio, and of the run, for each latency.
    minutes
        Duration of the audio for the memory run; 0 skips it.
    speed
        Speed of the memory run relative to real time.
    hop
        Hop in seconds, in both runs.
    string
        String preset, pressed at two fifths of its length.
    """

    seconds: Annotated[Seconds, Meta(ge=0.2, le=FINITE)] = 20.0
    minutes: NonNegative[float] = 10.0
    speed: Positive[float] = 20.0
    hop: Seconds = 0.01
    string: str = "plain_012"

    def run(self) -> Iterator[Row]:
        """Measure the latency, its stages, then the memory."""
        with tempfile.TemporaryDirectory() as folder, one_core():
            path = Path(folder) / "string.wav"
            write_take(path, load_string(self.string), TAKE, RATE)
            one_sided = yield from self._latency("latency", self._take(path, 1.0, self.seconds))
            yield from _counted(one_sided)
            yield from _filter(one_sided)
            both = {"source": {"name": "split_string"}, "estimator": {"name": "closed_form"}}
            yield from self._latency("two-sided latency", both)
            if self.minutes > 0.0:
                yield from self._memory(path)

    def _latency(self, name: str, tree: Tree) -> Generator[Row, None, Summary]:
        baseline = _Autocorrelation()
        summary = _whole(run(self._session(tree, self.seconds, baseline)))
        seen, beside = summary.stages["latency"], baseline.histogram.percentiles()
        for percentile, label in (("p50", "p50"), ("p95", "p95"), ("p99", "p99"), ("longest", "max")):
            value, compared = (1e3 * getattr(summary, percentile) for summary in (seen, beside))
            yield row(f"{name} {label}", value, "ms", AUTOCORRELATION, compared)
        return summary

    def _memory(self, path: Path) -> Iterator[Row]:
        memory = _Memory(settled=min(60.0, 6.0 * self.minutes))
        seconds = 60.0 * self.minutes
        summary = _whole(run(self._session(self._take(path, self.speed, seconds), seconds, memory)))
        now = resident()
        yield row("pace of the memory run", memory.pace, "x real time", "asked for", self.speed)
        yield row("windows of the memory run", summary.windows, "1")
        yield row("skipped in the memory run", summary.skipped, "1")
        settled = f"resident after {memory.settled:g} s of audio"
        yield row("resident at the end", now, "MB", settled, memory.megabytes)
        yield row("memory growth", now - memory.megabytes, "MB")

    def _take(self, path: Path, speed: float, seconds: Seconds) -> Tree:
        preset = load_string(self.string)
        return {
            "source": {
                "name": "wav",
                "path": str(path),
                "block": 64 if speed <= 1.0 else 512,
                "speed": speed,
                "repeat": math.ceil(seconds / TAKE) + 1,
            },
            "estimator": {
                "name": "closed_form",
                "length": preset.string.length,
                "open_frequency": preset.open_frequency,
            },
        }

    def _session(self, tree: Tree, seconds: Seconds, sink: Listener) -> LiveRun:
        setup = LiveRun.read({**tree, "window": {"hop": self.hop}, "sinks": {}, "seconds": seconds})
        return dataclasses.replace(setup, sinks=(sink,))


class _Autocorrelation(Listener):
    """Times the baseline on the same windows: autocorrelation through the FFT, and its peak."""

    def __init__(self) -> None:
        self.histogram = Histogram()

    def write(self, update: Update) -> None:
        begin = time.monotonic()
        samples = update.window.samples[0]
        spectrum = np.fft.rfft(samples, 2 * samples.size)
        lags = np.fft.irfft(np.abs(spectrum) ** 2)[: samples.size]
        lags[: RATE // 1500].fill(-np.inf)
        np.argmax(lags)
        self.histogram.add(time.monotonic() - begin)


class _Memory(Listener):
    """Records the resident memory once the loop has settled, and times the windows.

    The pace is that of the windows, without the program's start-up.
    """

    def __init__(self, settled: Seconds) -> None:
        self.settled = settled
        self.megabytes = math.nan
        self._first: tuple[Seconds, Seconds] | None = None  # a window's time in the audio, and on the clock
        self._last: tuple[Seconds, Seconds] = (0.0, 0.0)

    def write(self, update: Update) -> None:
        self._last = update.prediction.time, time.monotonic()
        self._first = self._first or self._last
        if math.isnan(self.megabytes) and update.prediction.time >= self.settled:
            self.megabytes = resident()

    @property
    def pace(self) -> float:
        """Seconds of audio per second, from the first window to the last."""
        if self._first is None or self._last == self._first:
            return math.nan
        return (self._last[0] - self._first[0]) / (self._last[1] - self._first[1])


def _whole(summary: Summary) -> Summary:
    """Return the summary of a complete run; an interrupted run is not a measurement."""
    if summary.interrupted:
        raise KeyboardInterrupt
    return summary


def _counted(summary: Summary) -> Iterator[Row]:
    for stage in ("read", "estimate", "sinks"):
        seen = summary.stages[stage]
        yield row(f"stage {stage} p50", 1e3 * seen.p50, "ms")
        yield row(f"stage {stage} p99", 1e3 * seen.p99, "ms")
    yield row("windows", summary.windows, "1")
    yield row("windows skipped", summary.skipped, "1")
    yield row("deadline misses", summary.deadline_misses, "1")
    yield row("windows with a position", summary.valid / max(summary.windows, 1), "1")


def _filter(summary: Summary) -> Iterator[Row]:
    """Time the filter on synthetic touches of 2 s that press and then slide, every 3 s."""
    state, settings, taken = FilterState(), FilterSettings(), Histogram()
    for k in range(FILTERED):
        at = k % 300 / 100.0
        prediction = Prediction(
            start=441 * k, time=0.01 * k, estimates=_touch(touched=at < 2.0, slides=at > 1.0)
        )
        begin = time.perf_counter()
        state, _ = step(state, prediction, 0.1, settings)
        taken.add(time.perf_counter() - begin)
    seen, beside = taken.percentiles(), summary.stages["estimate"]
    yield row("filter p50", 1e3 * seen.p50, "ms", ESTIMATE, 1e3 * beside.p50)
    yield row("filter p99", 1e3 * seen.p99, "ms", ESTIMATE, 1e3 * beside.p99)


def _touch(*, touched: bool, slides: bool) -> Estimates:
    if not touched:
        contact = Estimate(value=0.01, std=0.1, unit="")
        return {"contact": contact} | {
            name: Estimate.abstain(unit, Reason.NO_CONTACT)
            for name, unit in (("slip", ""), ("position", "m"), ("force", "N"))
        }
    return {
        "contact": Estimate(value=0.99, std=0.1, unit=""),
        "slip": Estimate(value=0.9 if slides else 0.02, std=0.3, unit=""),
        "position": Estimate(value=0.08, std=4e-4, unit="m"),
        "force": Estimate(value=1.0, std=0.3, unit="N"),
    }
