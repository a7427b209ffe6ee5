"""A recorded session, played again."""

import math
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from monochord.capture.sources._paced_stream import PacedStream
from monochord.capture.sources._rates import refuse_other_rates
from monochord.capture.sources._track_truth import TrackTruth
from monochord.capture.sources.base import Source
from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal, Truth
from monochord.core.units import Samples
from monochord.sessions import Session, read_session
from monochord.sessions.alignment import AUDIO, align

MOST_CHANNELS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSource(Source):
    """A session (.mcap): its audio with the gaps that it has, and its labels as truth.

    Frames have the indices that they had when they were recorded, so that windows, and whatever is estimated
    from them, are the same as they were live. A session that was cut off is played as far as it is whole.

    Parameters
    ----------
    path
        The file.
    block
        Frames a block; one before a gap holds what is left.
    speed
        Pace against real time: 1 gives each block when its last frame would have been heard, 20 twenty times
        as fast, 0 as fast as it is read.
    aligned
        Whether labels are taken to be on the clock of the force, where there is one, as the twin's and those
        of a measurement are: what taps tell of the microphones' lateness is then taken off. It costs the time
        to find the taps; without it labels are taken to be on the microphones' clock.
    """

    path: Path
    block: Samples = 512
    speed: float = 0.0
    aligned: bool = True

    @contextmanager
    def open(self) -> Generator["_SessionStream"]:
        """Open the file; raises `InputError` where it or an option cannot be used."""
        if self.block < 1:
            raise InputError(f"block of {self.block} frames", "1 frame or more")
        if not 0.0 <= self.speed < math.inf:
            raise InputError(f"speed {self.speed}", "0 (as fast as possible) or more")
        session = read_session(Path(self.path))
        channels, what = session.description.channels, f"session {self.path}"
        if channels > MOST_CHANNELS:
            raise InputError(f"{what} with {channels} channels", "1 or 2", "export it, keep the pickups'")
        refuse_other_rates(session.description.sample_rate, what, "export it, and resample that")
        if not session.audio.samples.shape[1]:
            raise InputError(f"{what} (0 frames of audio)", "1 frame or more")
        stream = _SessionStream(session, self)
        try:
            yield stream
        finally:
            stream.release()


class _SessionStream(PacedStream):
    def __init__(self, session: Session, options: SessionSource) -> None:
        told, track = session.description, session.audio
        signal = Signal(sample_rate=told.sample_rate, channels=told.channels, string=told.string)
        end = track.samples.shape[1]
        super().__init__(signal, block=options.block, speed=options.speed, end=end)
        self._samples = track.samples
        self._gaps_after = dict(track.gaps)
        self._firsts = np.array([*(first for first, _ in track.gaps), end])
        labels = session.labels
        bare = not (options.aligned and session.streams and len(labels.time))
        self._alignment = None if bare else align(session)
        self._line, self._truth = track.line, TrackTruth(labels.time, labels.columns)

    def truth(self, start: Samples, stop: Samples) -> Truth:
        """Return what the session's labels say of the frames [start, stop)."""
        rate, begin = self._line
        when = begin + np.array([start, stop]) / rate
        if self._alignment is not None:
            when = self._alignment.correct(AUDIO, when)
        return self._truth.over(*when.tolist())

    def _lost(self) -> Samples:
        return self._gaps_after.get(self._start, self._start) - self._start

    def _read(self, frames: Samples) -> Audio:
        """Return the next frames, at most to the next gap."""
        whole_until = self._firsts[np.searchsorted(self._firsts, self._start, side="right")]
        return self._samples[:, self._start : min(self._start + frames, int(whole_until))]
