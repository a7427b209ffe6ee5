"""The tracks of a session as arrays; all times are seconds since the session's beginning."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Audio, Feed, Floats
from monochord.core.units import Samples, Seconds

AUDIO, LABELS = "audio", "labels"
"""Names of the streams in every session: the audio and the labels."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AudioTrack:
    """The microphones' samples (channels, n) float32 from the stream's first frame on.

    Lost frames are zeros; `gaps` lists the first lost frame and the one after the last. Frame `anchor_frame`
    (k,) was at the converter at `anchor_time` (k,), as reported by the device; `device_frame` (k,) is the
    device's count there, -1 where it has none.
    """

    samples: Audio
    sample_rate: int
    gaps: tuple[tuple[Samples, Samples], ...] = ()
    anchor_frame: Floats
    anchor_time: Floats
    device_frame: NDArray[np.int64]

    def __repr__(self) -> str:
        channels, frames = self.samples.shape
        what = f"{frames / self.sample_rate:.2f} s of {channels} channels at {self.sample_rate} Hz"
        return f"AudioTrack: {what}, {len(self.gaps)} gaps"

    @property
    def line(self) -> tuple[float, Seconds]:
        """Sample rate, and the time of frame 0, of the line through the anchors.

        The converter's clock is steady, so one line fits all anchors but outliers. With fewer than two
        anchors, or less than a second of them, the nominal rate is used.
        """
        frames, times, rate = self.anchor_frame, self.anchor_time, float(self.sample_rate)
        if not len(frames):
            return rate, 0.0
        start = float(np.median(times - frames / rate))
        if len(frames) < 3 or frames[-1] - frames[0] < rate:
            return rate, start
        left = times - (start + frames / rate)
        near = np.ones(len(frames), dtype=bool)
        slope, shift = 0.0, 0.0
        for _ in range(3):
            slope, shift = np.polyfit(frames[near], left[near], 1)
            off = np.abs(left - (shift + slope * frames))
            near = off <= max(3.0 * float(np.median(off[near])), 1e-6)
        if abs(slope) * rate > 1e-3:  # no converter is off by a thousandth: the anchors are
            return rate, start
        return 1.0 / (1.0 / rate + slope), start + shift

    @property
    def unevenness(self) -> Seconds:
        """Largest lasting deviation of the device's times from the line, in s.

        It shows a sound server that stalled without counting frames: later sound is later than its frame
        count says. A single deviating time has no effect; the median of every five counts.
        """
        if len(self.anchor_time) < 5:
            return 0.0
        left = self.anchor_time - self.time(self.anchor_frame)
        middle = np.median(np.lib.stride_tricks.sliding_window_view(left, 5), axis=1)
        return float(np.abs(middle).max())

    def time(self, frame: Any) -> Any:
        """Return when frames were at the converter."""
        rate, start = self.line
        return start + np.asarray(frame) / rate

    def frame(self, time: Any) -> Any:
        """Return the frame, not rounded, that was at the converter at a time."""
        rate, start = self.line
        return (np.asarray(time) - start) * rate


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReadingTrack:
    """All readings of an instrument; see `monochord.core.types.Readings` for the arrays."""

    feed: Feed
    time: Floats
    values: Floats
    sequence: NDArray[np.int64]
    device_time: NDArray[np.int64]
    status: NDArray[np.uint32]

    def column(self, name: str) -> Floats:
        """Return the values (n,) of a column; raises `InputError` for an unknown column."""
        if name not in self.feed.columns:
            given = f"column '{name}' of stream '{self.feed.stream}'"
            raise InputError(given, ", ".join(self.feed.columns))
        return self.values[:, self.feed.columns.index(name)]

    @property
    def missing(self) -> int:
        """Number of readings lost by the sender's count; a count that restarts is not a loss."""
        steps = np.diff(self.sequence[self.sequence >= 0])
        return sum((steps[steps > 1] - 1).tolist())  # whose sum need not fit 64 bits


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """An event at a time; `text` is for a reader, `data` for a program."""

    time: Seconds
    kind: str
    text: str = ""
    data: Mapping[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClockTrack:
    """Offsets in s of clocks from the monotonic clock, by name (n,), measured at times (n,)."""

    time: Floats
    offsets: dict[str, Floats]
