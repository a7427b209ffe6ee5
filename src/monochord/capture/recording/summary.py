"""The summary of a recording."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from monochord.capture.recording.counters import FeedState, RecordingState
from monochord.capture.recording.watch import ONE_MICROPHONE
from monochord.core.reasons import Reason
from monochord.core.units import Samples, Seconds, decibels


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedSummary:
    """One instrument: its saved readings and counters; `rate` is over the whole recording."""

    stream: str
    readings: int
    missing: int
    faulty: int
    out_of_order: int
    reconnects: int
    rate: float

    @classmethod
    def of(cls, feed: FeedState, elapsed: Seconds) -> "FeedSummary":
        """Return the summary of an instrument over a time."""
        health = feed.health
        return cls(
            stream=feed.feed.stream,
            readings=feed.readings,
            missing=health.missing,
            faulty=max(feed.faulty, health.faulty),
            out_of_order=health.out_of_order,
            reconnects=health.reconnects,
            rate=feed.readings / elapsed if elapsed > 0.0 else 0.0,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSummary:
    """A finished recording; its file is complete and valid.

    `frames` were saved and `dropped` lost in `gaps`; `xruns` and `reconnects` are the source's counts. `peak`
    is each microphone's highest level in full scale; `clipped` and `not_numbers` count its samples.
    `instruments` are by name. `flags` counts the events by kind. `size` is the file's size in bytes,
    `stopped` the reason for the end, and `failure` the error that caused it, empty for none. `inputs` says
    why two channels are not two microphones, empty where they are. Where a disk filled up, the file may
    contain a tenth of a second more than counted here.
    """

    path: Path
    seconds: Seconds
    frames: Samples
    dropped: Samples
    gaps: int
    xruns: int
    reconnects: int
    peak: tuple[float, ...]
    clipped: tuple[Samples, ...]
    not_numbers: tuple[Samples, ...]
    instruments: Mapping[str, FeedSummary]
    flags: Mapping[str, int]
    size: int
    stopped: str
    failure: str = ""
    inputs: str = ""

    @property
    def interrupted(self) -> bool:
        """Whether the end was requested."""
        return Reason.of(self.stopped) is Reason.REQUESTED

    @classmethod
    def of(
        cls,
        path: Path,
        now: RecordingState,
        *,
        flags: Mapping[str, int],
        size: int,
        stopped: str,
        failure: str,
    ) -> "RecordingSummary":
        """Return the summary of a recording from its final state."""
        return cls(
            path=path,
            seconds=now.elapsed,
            frames=now.frames,
            dropped=now.dropped,
            gaps=now.gaps,
            xruns=now.health.xruns,
            reconnects=now.health.reconnects,
            peak=tuple(level.highest for level in now.levels),
            clipped=tuple(level.clipped for level in now.levels),
            not_numbers=tuple(level.not_numbers for level in now.levels),
            instruments={feed.name: FeedSummary.of(feed, now.elapsed) for feed in now.feeds},
            flags=dict(sorted(flags.items())),
            size=size,
            stopped=stopped,
            failure=failure,
            inputs=now.inputs.reason if ONE_MICROPHONE in flags else "",
        )

    def lines(self) -> list[str]:
        """Return the summary as text lines."""
        peaks = " / ".join(f"{decibels(peak):.1f}" for peak in self.peak)
        audio = {
            "frames": self.frames,
            "dropped": self.dropped,
            "gaps": self.gaps,
            "xruns": self.xruns,
            "reconnects": self.reconnects,
            "clipped": sum(self.clipped),
        }
        if any(self.not_numbers):
            audio["not numbers"] = sum(self.not_numbers)
        flags = ", ".join(f"{kind} {count}" for kind, count in self.flags.items()) or "none"
        return [
            f"{self.path}  {self.seconds:.1f} s  {1e-6 * self.size:.1f} MB  {self.stopped}",
            f"audio  {_counts(audio)}  peak {peaks} dBFS",
            *(_feed_line(name, feed) for name, feed in self.instruments.items()),
            f"flags  {flags}",
            *([f"silence: {Reason.SILENCE.remedy}"] if "silence" in self.flags else []),
            *([f"inputs  {self.inputs}"] if self.inputs else []),
        ]

    def tree(self) -> dict[str, Any]:
        """Return the summary as plain values."""
        return {**dataclasses.asdict(self), "path": str(self.path)}


def _feed_line(name: str, feed: FeedSummary) -> str:
    counts = {"readings": feed.readings, "missing": feed.missing, "faulty": feed.faulty}
    if feed.out_of_order:
        counts["out of order"] = feed.out_of_order
    return f"{name}  {_counts(counts)}  reconnects {feed.reconnects}  {feed.rate:.1f} a second"


def _counts(counts: Mapping[str, int]) -> str:
    return "  ".join(f"{name} {count}" for name, count in counts.items())
