"""Opens a wav or flac file for reading, or explains in one line why it cannot be used."""

import os
from dataclasses import dataclass
from mmap import ACCESS_COPY, mmap
from pathlib import Path
from typing import Any, BinaryIO, Literal

import soundfile

from monochord.capture.sources.base import refuse_other_rates
from monochord.core.errors import InputError
from monochord.core.files import refuse_endless, similar_name

FORMATS = ("WAV", "WAVEX", "RF64", "FLAC")
MAX_CHANNELS = 2
UNKNOWN_LENGTH = 0xFFFFFFFF  # what a program that writes to a pipe, or RF64, puts for a length

READ_ANYWAY = "read the rest: locate --allow-truncated, live --set source.allow_truncated=true"
ENDLESS = 2**63 - 1  # frames, as libsndfile puts it, of a flac stream that does not say how many


def open_audio(path: Path, *, allow_truncated: bool, max_channels: int = MAX_CHANNELS) -> soundfile.SoundFile:
    """Open a complete file with at most `max_channels` channels and a rate in the allowed range.

    Raises
    ------
    InputError
        If the file is missing, empty, not wav or flac, truncated (unless allowed), or has too many channels.
    """
    if path.is_dir():
        raise InputError(f"folder {path}", "a wav or flac file", "name one of its files")
    refuse_endless(path)
    if not path.exists():
        remedy = similar_name(path) or "check its name"
        raise InputError(f"file {path} (does not exist)", "an existing wav or flac file", remedy)
    if not path.stat().st_size:
        raise InputError(f"file {path} (empty)", "a wav or flac file with sound in it")
    file = _open(path, allow_truncated=allow_truncated)
    try:
        _refuse(file, path, max_channels)
        if not allow_truncated:
            _refuse_truncated(file, path)
    except BaseException:
        file.close()
        raise
    return file


def _open(path: Path, *, allow_truncated: bool) -> soundfile.SoundFile:
    allowed = "wav or flac sound"
    try:
        with path.open("rb") as file:
            magic = file.read(4)
            if magic not in (b"RIFF", b"RIFX", b"RF64", b"fLaC"):
                raise InputError(f"file {path} (begins with {magic!r})", allowed, "convert it")
            samples = None if magic == b"fLaC" else _samples_in(file)
            name: Any = os.fsencode(path)  # a name need not be text
            if samples is None or not _is_unfinished(file, samples):
                return soundfile.SoundFile(name)
            if not allow_truncated:
                given = f"file {path} (its recorder ended before it wrote the length)"
                raise InputError(given, "a whole file", READ_ANYWAY)
            content: Any = _finished(file, samples)  # which soundfile takes, as it has what a file has
            return soundfile.SoundFile(content)
    except soundfile.LibsndfileError as error:
        raise InputError(f"file {path} ({error.error_string.rstrip('.')})", allowed) from error
    except OSError as error:
        raise InputError(f"file {path} ({error.strerror})", "a readable wav or flac file") from error


def _refuse(file: soundfile.SoundFile, path: Path, max_channels: int) -> None:
    if file.format not in FORMATS:
        raise InputError(f"file {path} of format {file.format}", "wav or flac", "convert it")
    if file.channels > max_channels:
        allowed = "1 or 2" if max_channels == MAX_CHANNELS else f"{max_channels} at most"
        raise InputError(f"file {path} with {file.channels} channels", allowed, "keep the pickups' channels")
    refuse_other_rates(file.samplerate, f"file {path}", "resample it first")
    if not file.frames:
        raise InputError(f"file {path} (0 frames)", "1 frame or more")


def _refuse_truncated(file: soundfile.SoundFile, path: Path) -> None:
    if file.frames == ENDLESS:
        raise InputError(
            f"file {path} (does not state its length)",
            "a file that states its length",
            f"convert it, or {READ_ANYWAY}",
        )
    if file.format == "FLAC":
        whole = _last_frame_reads(file)
    else:
        with path.open("rb") as raw:
            whole = _is_complete(raw)
    if not whole:
        raise InputError(f"file {path} (truncated)", "a whole file", f"copy it again, or {READ_ANYWAY}")


def _last_frame_reads(file: soundfile.SoundFile) -> bool:
    try:
        file.seek(file.frames - 1)
        reads = len(file.read(1)) == 1
        file.seek(0)
    except soundfile.LibsndfileError:
        return False
    return reads


@dataclass(frozen=True, slots=True, kw_only=True)
class _Samples:
    """Where the samples of a RIFF file begin, and their size in bytes by its header.

    `order` is the byte order of its numbers; `wide` is the offset of an RF64 file's 64-bit lengths, else 0.
    """

    begin: int
    stated: int
    order: Literal["big", "little"]
    wide: int


def _samples_in(file: BinaryIO) -> _Samples | None:
    """Walk the chunks of a RIFF file to its samples; return None where there are none."""
    file.seek(0)
    order: Literal["big", "little"] = "big" if file.read(4) == b"RIFX" else "little"
    file.seek(12)
    wide = 0
    while len(head := file.read(8)) == 8:
        length = int.from_bytes(head[4:], order)
        begin = file.tell()
        if head[:4] == b"ds64":
            wide = begin
        if head[:4] == b"data":
            if length == UNKNOWN_LENGTH and wide:
                file.seek(wide + 8)
                length = int.from_bytes(file.read(8), order)
            return _Samples(begin=begin, stated=length, order=order, wide=wide)
        file.seek(begin + length + length % 2)
    return None


def _size(file: BinaryIO) -> int:
    return os.fstat(file.fileno()).st_size


def _is_unfinished(file: BinaryIO, samples: _Samples) -> bool:
    """Return whether a file's header states no samples, yet the data after it are not valid chunks."""
    size, at = _size(file), samples.begin
    if samples.stated:
        return False
    while at < size:
        file.seek(at)
        head = file.read(8)
        if len(head) < 8 or not (head[:4].isascii() and head[:4].decode().isprintable()):
            return True
        length = int.from_bytes(head[4:], samples.order)
        at += 8 + length + length % 2
    return at > size + 1  # the last byte of padding may be missing


def _finished(file: BinaryIO, samples: _Samples) -> mmap:
    """Return the file's bytes with corrected lengths. The file itself is not changed."""
    content = mmap(file.fileno(), 0, access=ACCESS_COPY)
    size = len(content)
    room = size - samples.begin
    lengths = {4: size - 8, samples.begin - 4: room - room % 2}  # behind an odd one, a byte would follow
    for at, length in lengths.items():
        content[at : at + 4] = min(length, UNKNOWN_LENGTH).to_bytes(4, samples.order)
        if samples.wide:
            wide = samples.wide + (0 if at == 4 else 8)
            content[wide : wide + 8] = length.to_bytes(8, samples.order)
            content[at : at + 4] = UNKNOWN_LENGTH.to_bytes(4, samples.order)
    return content


def _is_complete(file: BinaryIO) -> bool:
    """Return whether a RIFF file has all the samples that its header states."""
    samples = _samples_in(file)
    if samples is None:
        return False
    unknown = samples.stated == UNKNOWN_LENGTH  # a program that writes to a pipe puts it
    return unknown or samples.begin + samples.stated <= _size(file)
