"""A recording on disk, read block by block, as fast as possible or at the pace of a clock."""

import math
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile

from monochord.errors import InputError
from monochord.sources._audio_file import open_audio
from monochord.sources.base import Source, Stream
from monochord.types import Block, Signal, StreamHealth
from monochord.units import Samples, Seconds


@dataclass(frozen=True, kw_only=True)
class Wav(Source):
    """A wav or flac file of one or two channels at 16 to 96 kHz.

    Attributes
    ----------
    path
        The file.
    block
        Frames a block; the last one holds what is left.
    speed
        Pace against real time: 1 gives each block when its last frame would have been heard, 20 twenty times
        as fast, 0 as fast as it is read.
    repeat
        How many times to play the file, the sample index growing on; 0 without end.
    allow_truncated
        Whether to read what is there of a file that was cut short, to the last whole block.
    """

    path: Path
    block: Samples = 512
    speed: float = 0.0
    repeat: int = 1
    allow_truncated: bool = False

    @contextmanager
    def open(self) -> Generator["_FileStream"]:
        """Open the file; raises `InputError` where it or an option cannot be used."""
        if self.block < 1:
            raise InputError(f"block of {self.block} frames", "1 frame or more")
        if not 0.0 <= self.speed < math.inf:
            raise InputError(f"speed {self.speed}", "0 (as fast as possible) or more")
        if self.repeat < 0:
            raise InputError(f"repeat {self.repeat}", "0 (without end) or more")
        file = open_audio(Path(self.path), allow_truncated=self.allow_truncated)
        stream = _FileStream(file, self)
        try:
            yield stream
        finally:
            stream.release()


class _FileStream(Stream):
    def __init__(self, file: soundfile.SoundFile, options: Wav) -> None:
        self._file, self._options = file, options
        self._signal = Signal(sample_rate=file.samplerate, channels=file.channels)
        self._closed = threading.Event()
        self._reading = threading.Lock()
        self._start: Samples = 0
        self._round = 1
        self._began: Seconds | None = None  # when the pace began; None before the first block

    @property
    def signal(self) -> Signal:
        return self._signal

    @property
    def pending(self) -> Samples:
        """Frames in whole blocks that are due by the clock; zero where no pace is kept."""
        if not self._options.speed or self._began is None:
            return 0
        due = (time.monotonic() - self._began) * self._signal.sample_rate * self._options.speed - self._start
        return max(int(due // self._options.block) * self._options.block, 0)

    @property
    def health(self) -> StreamHealth:
        return StreamHealth(frames=self._start)

    def __iter__(self) -> Iterator[Block]:
        if self._began is None:
            self._began = time.monotonic()
        while (block := self._next()) is not None:
            yield block

    def close(self) -> None:
        """End the iteration, from whatever thread."""
        self._closed.set()

    def release(self) -> None:
        """Close, wait until the reader has left, and close the file."""
        self.close()
        with self._reading:
            self._file.close()

    def _next(self) -> Block | None:
        with self._reading:
            if self._closed.is_set():
                return None
            samples = self._read()
            if not samples.shape[1]:
                return None
            adc_time = self._await(self._start + samples.shape[1])
            block = Block(samples=samples, start=self._start, adc_time=adc_time)
            self._start += samples.shape[1]
            return None if self._closed.is_set() else block

    def _read(self) -> np.ndarray:
        """Return the next frames, (channels, n), running on from the file's end to its beginning."""
        parts = [self._read_here(self._options.block)]
        while (missing := self._options.block - sum(map(len, parts))) and self._round != self._options.repeat:
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
            self._file = soundfile.SoundFile(self._options.path)

    def _read_here(self, frames: Samples) -> np.ndarray:
        try:
            return self._file.read(frames, dtype="float32", always_2d=True)
        except soundfile.LibsndfileError as error:
            if self._options.allow_truncated:
                return np.zeros((0, self._signal.channels), np.float32)
            where = f"file {self._options.path} (unreadable after frame {self._start})"
            raise InputError(where, "an undamaged file", "copy it again") from error

    def _await(self, stop: Samples) -> Seconds | None:
        """Wait until frame `stop` is due; return the time of the block's first frame, where that is real."""
        speed, rate, began = self._options.speed, self._signal.sample_rate, self._began
        if not speed or began is None:
            return None
        self._closed.wait(max(began + stop / (rate * speed) - time.monotonic(), 0.0))
        return began + self._start / rate if speed == 1.0 else None
