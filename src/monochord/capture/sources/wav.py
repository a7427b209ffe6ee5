"""An audio file, read block by block, as fast as possible or at the pace of a clock."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile

from monochord.capture.sources._audio_file import open_audio, reopened
from monochord.capture.sources._paced_stream import PacedStream
from monochord.capture.sources.base import Source, refuse_other_channels
from monochord.core.errors import InputError
from monochord.core.ranges import Count, NonNegative, Whole
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples
from monochord.sessions.description import SIMULATED_COMMENT


@dataclass(frozen=True, slots=True, kw_only=True)
class Wav(Source):
    """A sound file of one or two channels (more for several strings), at 16 to 192 kHz.

    libsndfile reads it: wav, flac, mp3, ogg (Vorbis or Opus), aiff, au, caf, w64, told by content.

    Parameters
    ----------
    path
        The audio file.
    block
        Frames per block; the last block may be shorter.
    speed
        Playback speed: 1 is real time, 20 is twenty times as fast, 0 as fast as the file can be read.
    repeat
        How many times to play the file, with a continuous sample index; 0 without end.
    allow_truncated
        Whether to read a truncated file, up to its last complete block.
    channels
        Largest number of channels accepted.
    """

    path: Path
    block: Count = 512
    speed: NonNegative[float] = 0.0
    repeat: Whole = 1
    allow_truncated: bool = False
    channels: int = 2

    def open(self) -> "_FileStream":
        """Open the file; raises `InputError` where the file or an option cannot be used."""
        refuse_other_channels(self.channels)
        file = open_audio(Path(self.path), allow_truncated=self.allow_truncated, max_channels=self.channels)
        return _FileStream(file, self)


class _FileStream(PacedStream):
    def __init__(self, file: soundfile.SoundFile, options: Wav) -> None:
        signal = Signal(sample_rate=file.samplerate, channels=file.channels)
        end = file.frames * options.repeat or math.inf
        super().__init__(signal, block=options.block, speed=options.speed, end=end)
        self._file, self._options = file, options
        self._round = 1

    @property
    def simulated(self) -> bool:
        return self._file.comment == SIMULATED_COMMENT

    def _leave(self) -> None:
        self._file.close()

    def _read(self, frames: Samples) -> Audio:
        """Return the next frames, continuing from the file's end to its beginning."""
        parts = [self._read_here(frames)]
        while (missing := frames - sum(map(len, parts))) and self._round != self._options.repeat:
            self._round += 1
            self._rewind()
            parts.append(self._read_here(missing))
            if not len(parts[-1]):
                break  # nothing of it can be read
        return np.ascontiguousarray(np.concatenate(parts).T)

    def _rewind(self) -> None:
        try:
            self._file.seek(0)
        except soundfile.LibsndfileError:  # a flac decoder that met the end of a cut file stays where it is
            self._file.close()
            self._file = reopened(Path(self._options.path))

    def _read_here(self, frames: Samples) -> np.ndarray:
        try:
            return self._file.read(frames, dtype="float32", always_2d=True)
        except soundfile.LibsndfileError as error:
            if self._options.allow_truncated:
                return np.zeros((0, self._signal.channels), np.float32)
            where = f"file {self._options.path} (unreadable after frame {self._start})"
            raise InputError(where, "an undamaged file", "copy it again") from error
