"""Measures the cost of several strings: estimates per second for each, and the time per estimate."""

import dataclasses
import math
import multiprocessing
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from monochord.capture.sources import SOURCES
from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Seconds
from monochord.live import MODEL, LiveRun, WindowSettings, run
from monochord.live.sinks.base import Listener, Update

TAKE: Seconds = 3.0
"""Sound of the simulated string, repeated; each string starts elsewhere in it."""
OFFSET: Seconds = 0.3731
"""Not a multiple of a hop: no two strings share a window, which would be analysed only once."""
MAX_STRINGS = 32
"""Strings of one audio interface, limited by the sources' channels."""
BUILD = {"world": "plausible", "build": 131, "day": 51}
"""A build that no bundled model was trained on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StringsCost:
    """A run with `strings` strings: estimates per second of each, and processor time per estimate.

    `latency` is the 99th percentile of the time from a window's last sample being available to its estimate,
    `skipped` the share of windows left out because the loop was late.
    """

    strings: int
    rate: float
    cost: Seconds
    latency: Seconds
    skipped: float


def refuse_options(strings: Sequence[int], seconds: Seconds, processes: int = 1) -> None:
    """Raise `InputError` for an unmeasurable number of strings or processes, or length of sound."""
    if not strings or not all(1 <= each <= MAX_STRINGS for each in strings):
        given = ", ".join(map(str, strings)) or "none"
        raise InputError(f"strings {given}", f"numbers from 1 to {MAX_STRINGS}")
    if not 0.3 <= seconds <= 3600.0:
        raise InputError(f"seconds {seconds:g}", "0.3 to 3600 s")
    if not 1 <= processes <= MAX_STRINGS:
        raise InputError(f"processes {processes}", f"1 to {MAX_STRINGS}")


def strings_cost(
    strings: int, *, seconds: Seconds = 5.0, hop: Seconds = 0.01, model: str = "demo", processes: int = 1
) -> StringsCost:
    """Run a model on several simulated strings in real time, and return the cost.

    Everything in the live loop except sinks counts: reading, windows, features, heads, estimates over time,
    events and health. Processor time is that of the whole process, from the first window on.

    Parameters
    ----------
    strings
        Number of strings, with two channels each.
    seconds
        Duration of the sound, and of the run.
    hop
        Hop, in s.
    model
        Folder or name of the model.
    processes
        Number of parallel processes that share the strings. Rate and latency are then the slowest process's;
        cost and skipped windows are over all.
    """
    if processes > 1:
        return _shared(strings, processes, {"seconds": seconds, "hop": hop, "model": model})
    import soundfile  # noqa: PLC0415

    take, clock = _take(), _Clock()
    rate = 44100
    sound = np.concatenate([np.roll(take, -round(k * OFFSET * rate), axis=1) for k in range(strings)])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "strings.wav"
        soundfile.write(path, sound.T, rate, subtype="FLOAT")
        played = {"path": str(path), "speed": 1.0, "repeat": 0, "block": 64}
        setup = LiveRun.read(
            {
                "source": {"name": "wav", **played},
                "estimator": {"name": MODEL, "path": model},
                "strings": {f"s{k + 1}": {"sensor": "prototype"} for k in range(strings)},
                "sinks": {},
                "window": {"length": WindowSettings().length, "hop": hop},
                "seconds": seconds,
            }
        )
        summary = run(dataclasses.replace(setup, sinks=(clock,)))
    total = summary.windows + summary.skipped
    return StringsCost(
        strings=strings,
        rate=clock.rate / strings,
        cost=clock.cost,
        latency=summary.stages["latency"].p99,
        skipped=summary.skipped / max(total, 1),
    )


def _shared(strings: int, processes: int, options: Mapping[str, Any]) -> StringsCost:
    """Return the cost of strings shared among processes."""
    each = [strings // processes + (number < strings % processes) for number in range(processes)]
    each = [count for count in each if count]
    with ProcessPoolExecutor(len(each), multiprocessing.get_context("spawn")) as pool:
        started = [pool.submit(strings_cost, count, **options) for count in each]
        seen = [run.result() for run in started]
    return StringsCost(
        strings=strings,
        rate=min(run.rate for run in seen),
        cost=float(np.average([run.cost for run in seen], weights=each)),
        latency=max(run.latency for run in seen),
        skipped=float(np.average([run.skipped for run in seen], weights=each)),
    )


def _take() -> Audio:
    """Return the sound (2, n) of a simulated string with occasional touches."""
    with SOURCES.build("twin", {"speed": 0.0, **BUILD}).open() as stream:
        frames = round(TAKE * stream.signal.sample_rate)
        blocks = [block.samples for block in takewhile(lambda block: block.start < frames, stream)]
        return np.concatenate(blocks, axis=1)[:, :frames]


class _Clock(Listener):
    """Records clock and processor time at the first and the last update."""

    def __init__(self) -> None:
        self._count = 0
        self._first = self._last = (0.0, 0.0)

    def write(self, update: Update) -> None:  # noqa: ARG002
        self._last = time.monotonic(), time.process_time()
        self._first = self._last if self._count == 0 else self._first
        self._count += 1

    @property
    def rate(self) -> float:
        """Updates per second."""
        elapsed = self._last[0] - self._first[0]
        return (self._count - 1) / elapsed if elapsed else math.nan

    @property
    def cost(self) -> Seconds:
        """Processor time per update, in s."""
        return (self._last[1] - self._first[1]) / (self._count - 1) if self._count > 1 else math.nan
