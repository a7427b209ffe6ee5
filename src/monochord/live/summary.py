"""Counts and timings of a live run."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from monochord.core.timing import Histogram, Percentiles
from monochord.core.types import Prediction, StreamHealth
from monochord.core.units import Samples, Seconds
from monochord.live.delivery import Delivered

STAGES = ("read", "estimate", "follow", "sinks", "latency", "capture")


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """A finished run.

    `frames` were read and `windows` estimated, of which `valid` have a position. `skipped` windows were left
    out because the reader was late, and `deadline_misses` came later than one hop after their last sample was
    available. `stages` holds the percentiles of each stage: ``read`` (last sample available to window cut),
    ``estimate``, ``follow`` (estimates over time), ``sinks``, ``latency`` (last sample available to estimate)
    and, where the source knows its converter's clock, ``capture`` (last sample at the converter to estimate).
    `delivered` holds each sink's counts.
    """

    frames: Samples
    windows: int
    valid: int
    skipped: int
    deadline_misses: int
    health: StreamHealth
    stages: Mapping[str, Percentiles]
    interrupted: bool = False
    delivered: tuple[Delivered, ...] = ()

    def lines(self) -> list[str]:
        """Return the summary as text lines."""
        health = self.health
        counted = {
            "windows": self.windows,
            "with a position": self.valid,
            "skipped": self.skipped,
            "deadline misses": self.deadline_misses,
        }
        stream = {
            "frames": self.frames,
            "dropped": health.dropped,
            "gaps": health.gaps,
            "xruns": health.xruns,
            "reconnects": health.reconnects,
        }
        timed = [f"{name:<9}{seen.line()}" for name, seen in self.stages.items() if seen.count]
        return [_counts(counted), _counts(stream), *timed, *_sinks(self.delivered), *_clocks(health)]

    def tree(self) -> dict[str, Any]:
        """Return the summary as plain values."""
        counts = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        health = {f.name: getattr(self.health, f.name) for f in dataclasses.fields(self.health)}
        health["clock_offsets"] = dict(self.health.clock_offsets)
        stages = {name: dataclasses.asdict(seen) for name, seen in self.stages.items() if seen.count}
        sinks = [dataclasses.asdict(each) for each in self.delivered]
        return counts | {"health": health, "stages": stages, "delivered": sinks}


class LoopMeter:
    """Counts and times a running loop in fixed memory."""

    def __init__(self, *, deadline: Seconds) -> None:
        self._deadline = deadline
        self._stages = {name: Histogram() for name in STAGES}
        self._windows = self._valid = self._misses = 0
        self.skipped = 0
        self.interrupted = False

    def skip(self, windows: int = 1) -> None:
        """Count skipped windows."""
        self.skipped += windows

    def add(
        self,
        prediction: Prediction,
        *,
        read: Seconds,
        estimate: Seconds,
        sinks: Seconds,
        follow: Seconds = 0.0,
    ) -> None:
        """Count a prediction and time its stages."""
        self._windows += 1
        self._valid += prediction.estimate("position").valid
        self._misses += prediction.latency > self._deadline
        latency = prediction.latency
        spans = {"read": read, "estimate": estimate, "follow": follow, "sinks": sinks, "latency": latency}
        for name, span in spans.items():
            self._stages[name].add(span)

    def add_capture(self, captured: Seconds | None, done: Seconds) -> None:
        """Time a window from the converter to the estimate, where the converter's time is known."""
        if captured is not None:
            self._stages["capture"].add(done - captured)

    def summary(
        self, frames: Samples, health: StreamHealth, delivered: tuple[Delivered, ...] = ()
    ) -> Summary:
        """Return the counts so far, with frames read, the stream's counters and those of sinks."""
        return Summary(
            frames=frames,
            windows=self._windows,
            valid=self._valid,
            skipped=self.skipped,
            deadline_misses=self._misses,
            health=health,
            stages={name: histogram.percentiles() for name, histogram in self._stages.items()},
            interrupted=self.interrupted,
            delivered=delivered,
        )


def _counts(counted: Mapping[str, int]) -> str:
    return "  ".join(f"{name} {count}" for name, count in counted.items())


def _sinks(delivered: tuple[Delivered, ...]) -> list[str]:
    """Return the sinks that left windows out or failed."""
    lacking = [each for each in delivered if each.left_out or each.failure]
    return [f"{'sink':<9}{each.line()}" for each in lacking]


def _clocks(health: StreamHealth) -> list[str]:
    """Return each clock's drift against the monotonic clock, where the stream knows it."""
    ahead = "  ".join(f"{name} {offset:+.6f} s" for name, offset in health.clock_offsets.items())
    return [f"{'clocks':<9}{ahead} against monotonic"] if ahead else []
