"""Plays back a recorded session."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from monochord.capture.sources._paced_stream import PacedStream
from monochord.capture.sources.base import Source, refuse_other_rates
from monochord.core.errors import InputError
from monochord.core.labels import LabelTrack, one_window_labels
from monochord.core.ranges import Count, NonNegative
from monochord.core.types import Audio, Signal, Truth
from monochord.core.units import Samples
from monochord.physics.sensors import RULER_STD
from monochord.sessions import SessionReader, read_session
from monochord.sessions.alignment import AUDIO, Alignment, align, calibration_spans

MAX_CHANNELS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSource(Source):
    """A session (.mcap): its audio with the recorded gaps, and its labels as truth.

    Frames keep their recorded indices, so that windows and estimates equal the live ones. A session that was
    cut off plays up to its damage.

    Parameters
    ----------
    path
        The session file.
    block
        Frames per block; a block before a gap may be shorter.
    speed
        Playback speed: 1 is real time, 20 is twenty times as fast, 0 as fast as the file can be read.
    aligned
        Whether labels are on the force sensor's clock, where there is one: this holds for the twin's and for
        measured labels. The microphones' delay, estimated from taps, is then subtracted, which takes time to
        detect the taps. Otherwise labels are on the microphones' clock.
    """

    path: Path
    block: Count = 512
    speed: NonNegative[float] = 0.0
    aligned: bool = True

    def open(self) -> "_SessionStream":
        """Open the file; raises `InputError` where the file or an option cannot be used."""
        session = read_session(Path(self.path))
        channels, what = session.description.channels, f"session {self.path}"
        if channels > MAX_CHANNELS:
            raise InputError(f"{what} with {channels} channels", "1 or 2", "export it, keep the pickups'")
        refuse_other_rates(session.description.sample_rate, what, "resample it: monochord sessions resample")
        if not session.audio.samples.shape[1]:
            raise InputError(f"{what} (0 frames of audio)", "1 frame or more")
        return _SessionStream(session, self)


class _SessionStream(PacedStream):
    def __init__(self, session: SessionReader, options: SessionSource) -> None:
        about, track = session.description, session.audio
        signal = Signal(
            sample_rate=about.sample_rate,
            channels=about.channels,
            string=about.string,
            sensor=about.identity,
        )
        if about.sensor.get("measured_length") is not None:
            signal = replace(signal, length_std=RULER_STD)
        end = track.samples.shape[1]
        super().__init__(signal, block=options.block, speed=options.speed, end=end)
        self._samples, self._simulated = track.samples, about.simulated
        self._gaps_after = dict(track.gaps)
        self._gap_starts = np.array([*(first for first, _ in track.gaps), end])
        labels = session.labels
        aligned = options.aligned and session.streams and len(labels.time)
        self._alignment = align(session) if aligned else Alignment(reference=AUDIO, lateness={})
        self._calibrating = calibration_spans(session, self._alignment)
        time = np.maximum.accumulate(labels.time) if len(labels.time) else labels.time
        self._line, self._labels = track.line, LabelTrack(time=time, columns=labels.columns)

    @property
    def simulated(self) -> bool:
        return self._simulated

    def truth(self, start: Samples, stop: Samples) -> Truth:
        """Return the labels of the window of frames [start, stop), by the rules of `monochord.core.labels`.

        Labels are unknown while the drivers are off for the taps.
        """
        rate, origin = self._line
        begin, end = self._alignment.correct(AUDIO, origin + np.array([start, stop]) / rate).tolist()
        if any(end > first and begin < last for first, last in self._calibrating):
            return {}
        return one_window_labels(self._labels, begin, end)

    def _lost(self) -> Samples:
        return self._gaps_after.get(self._start, self._start) - self._start

    def _read(self, frames: Samples) -> Audio:
        """Return the next frames, up to the next gap."""
        end = self._gap_starts[np.searchsorted(self._gap_starts, self._start, side="right")]
        return self._samples[:, self._start : min(self._start + frames, int(end))]
