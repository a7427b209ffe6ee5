"""Opens a wav or flac file for reading, or says in one line why it cannot be used."""

import os
from pathlib import Path
from typing import Any, BinaryIO

import soundfile

from monochord.capture.sources.base import refuse_other_rates
from monochord.core.errors import InputError

FORMATS = ("WAV", "WAVEX", "RF64", "FLAC")
MAX_CHANNELS = 2
UNKNOWN_LENGTH = 0xFFFFFFFF  # what a program that writes to a pipe, or RF64, puts for a length

READ_ANYWAY = "read what is there: locate --allow-truncated, live --set source.allow_truncated=true"
ENDLESS = 2**63 - 1  # frames, as libsndfile puts it, of a flac stream that does not say how many


def open_audio(path: Path, *, allow_truncated: bool, most: int = MAX_CHANNELS) -> soundfile.SoundFile:
    """Return the open file, seen to be whole, of `most` channels at most and a rate in the allowed range.

    Raises
    ------
    InputError
        If the file is missing, empty, not wav or flac, truncated (unless allowed), or of another shape.
    """
    if path.is_dir():
        raise InputError(f"folder {path}", "a wav or flac file", "name one of its files")
    if not path.exists():
        raise InputError(f"file {path} (not there)", "an existing wav or flac file", "check its name")
    if not path.stat().st_size:
        raise InputError(f"file {path} (empty)", "a wav or flac file with sound in it")
    file = _open(path)
    try:
        _refuse(file, path, most)
        if not allow_truncated:
            _refuse_truncated(file, path)
    except BaseException:
        file.close()
        raise
    return file


def _open(path: Path) -> soundfile.SoundFile:
    allowed = "wav or flac sound"
    try:
        with path.open("rb") as file:
            magic = file.read(4)
        if magic not in (b"RIFF", b"RIFX", b"RF64", b"fLaC"):
            raise InputError(f"file {path} (begins with {magic!r})", allowed, "convert it")
        name: Any = os.fsencode(path)  # a name need not be text
        return soundfile.SoundFile(name)
    except soundfile.LibsndfileError as error:
        raise InputError(f"file {path} ({error.error_string.rstrip('.')})", allowed) from error
    except OSError as error:
        raise InputError(f"file {path} ({error.strerror})", "a readable wav or flac file") from error


def _refuse(file: soundfile.SoundFile, path: Path, most: int) -> None:
    if file.format not in FORMATS:
        raise InputError(f"file {path} of format {file.format}", "wav or flac", "convert it")
    if file.channels > most:
        allowed = "1 or 2" if most == MAX_CHANNELS else f"{most} at most"
        raise InputError(f"file {path} with {file.channels} channels", allowed, "keep the pickups' channels")
    refuse_other_rates(file.samplerate, f"file {path}", "resample it first")
    if not file.frames:
        raise InputError(f"file {path} (0 frames)", "1 frame or more")


def _refuse_truncated(file: soundfile.SoundFile, path: Path) -> None:
    if file.frames == ENDLESS:
        raise InputError(
            f"file {path} (does not say how long it is)", "one that does", f"convert it, or {READ_ANYWAY}"
        )
    if file.format == "FLAC":
        whole = _last_frame_reads(file)
    else:
        with path.open("rb") as raw:
            whole = _holds_what_it_promises(raw, path.stat().st_size)
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


def _holds_what_it_promises(file: BinaryIO, size: int) -> bool:
    """Walk the chunks of a RIFF file to its samples; return whether the file reaches to their end."""
    order = "big" if file.read(4) == b"RIFX" else "little"
    file.seek(12)
    wide = 0  # the 64-bit length of an RF64 file's samples
    while len(head := file.read(8)) == 8:
        length = int.from_bytes(head[4:], order)
        if head[:4] == b"ds64":
            wide = int.from_bytes(file.read(16)[8:], "little")
            file.seek(-16, 1)
        if head[:4] == b"data":
            length = wide if length == UNKNOWN_LENGTH else length
            return file.tell() + length <= size
        file.seek(length + length % 2, 1)
    return False
