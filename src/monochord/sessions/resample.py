"""Resample a session: a dataset has one sample rate, and a model reads sound at that of its training."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from monochord.core.errors import InputError
from monochord.core.types import Block
from monochord.core.units import Seconds
from monochord.dsp.resample import resampled
from monochord.sessions.exports import Stretch, tables, write_back
from monochord.sessions.reader import SessionReader
from monochord.sessions.tracks import AudioTrack

BLOCK: Seconds = 0.1


def resample(session: SessionReader, path: Path, sample_rate: int) -> None:
    """Write a copy of a session with its sound at another sample rate; all other data and all times stay.

    Frames are those that a live run of the session reads, by `dsp.resample.resampled`. Raises `InputError`
    where the session already has that rate, or the new file exists; on an error, no file is left behind.
    """
    given = f"session {session.path} at {session.description.sample_rate} Hz"
    if sample_rate < 1:
        raise InputError(f"{given}, to {sample_rate} Hz", "1 Hz or more")
    if sample_rate == session.description.sample_rate:
        raise InputError(f"{given} already", "another rate", "use the session unchanged")
    more = {**session.description.more, "resampled": f"from {session.description.sample_rate} Hz"}
    description = replace(session.description, sample_rate=sample_rate, more=more)
    write_back(path, description, session.clock, _stretches(session.audio, sample_rate), tables(session))


def _stretches(audio: AudioTrack, rate: int) -> Iterator[Stretch]:
    """Yield the resampled sound, each frame at its time in the track."""
    ratio = rate / audio.sample_rate
    for block in resampled(_blocks(audio), sample_rate=audio.sample_rate, new_rate=rate):
        yield Stretch(
            start=block.start,
            dropped=block.dropped,
            time=float(audio.time(block.start / ratio)),
            timed=bool(len(audio.anchor_frame)),
            device_frame=-1,
            samples=block.samples,
        )


def _blocks(audio: AudioTrack) -> Iterator[Block]:
    """Yield the recorded sound, from gap to gap."""
    size, reached = round(BLOCK * audio.sample_rate), 0
    ends = (*(first for first, _ in audio.gaps), audio.samples.shape[1])
    begins = (0, *(stop for _, stop in audio.gaps))
    for begin, end in zip(begins, ends, strict=True):
        for start in range(begin, end, size):
            samples = audio.samples[:, start : min(start + size, end)]
            yield Block(samples=samples, start=start, dropped=start - reached)
            reached = start + samples.shape[1]
