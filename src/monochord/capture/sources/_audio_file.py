"""Opens a sound file that libsndfile reads, or explains in one line why it cannot be used."""

import os
from dataclasses import dataclass
from mmap import ACCESS_COPY, mmap
from pathlib import Path
from shlex import quote
from typing import Any, BinaryIO, Literal

import soundfile

from monochord.capture.sources.base import refuse_other_rates
from monochord.core.errors import InputError
from monochord.core.files import refuse_endless, similar_name

READABLE = "wav, flac, mp3, ogg, aiff, au, caf or w64"
"""The formats that are read; libsndfile tells them, and rarer ones, by their content."""
CHUNKED = b"RIFFWAVE", b"RIFXWAVE", b"RF64WAVE", b"FORMAIFF", b"FORMAIFC"
"""Bytes 0 to 3 and 8 to 11 of the formats that state how many bytes of samples follow: wav and aiff."""
NEED_CONVERSION = {
    b"ftyp": "m4a or mp4",
    b"\xff\xf1": "AAC",
    b"\xff\xf9": "AAC",
    b"\x1a\x45\xdf\xa3": "webm or mkv",
    b"\x30\x26\xb2\x75": "wma",
    b"#!AMR": "amr",
}
"""Sound that phones and browsers write and libsndfile does not read, by first bytes (mp4's from byte 4)."""
OGG_PAGE, OGG_HEADER, OGG_LAST = 65307, 27, 4
"""Most bytes of an ogg page, those of its header without the lengths, and the flag of the last page."""
MAX_CHANNELS = 2
UNKNOWN_LENGTH = 0xFFFFFFFF  # what a program that writes to a pipe, or RF64, puts for a length

READ_ANYWAY = (
    "read the rest: --allow-truncated (locate, sessions import, sessions touches), "
    "--set source.allow_truncated=true (live, record, tune)"
)
ENDLESS = 2**63 - 1  # frames, as libsndfile puts it, of a flac stream that does not say how many


def open_audio(path: Path, *, allow_truncated: bool, max_channels: int = MAX_CHANNELS) -> soundfile.SoundFile:
    """Open a complete file with at most `max_channels` channels and a rate in the allowed range.

    `InputError` refuses a file that is missing, empty, of a format that libsndfile does not read, truncated
    (unless allowed), or of too many channels.
    """
    if path.is_dir():
        raise InputError(f"folder {path}", "a sound file", "name one of its files")
    refuse_endless(path)
    if not path.exists():
        remedy = similar_name(path) or "check its name"
        raise InputError(f"file {path} (does not exist)", "an existing sound file", remedy)
    if not path.stat().st_size:
        raise InputError(f"file {path} (empty)", "a file with sound in it")
    file = _open(path, allow_truncated=allow_truncated)
    try:
        _refuse(file, path, max_channels)
        if not allow_truncated:
            _refuse_truncated(file, path)
    except BaseException:
        file.close()
        raise
    return file


def reopened(path: Path) -> soundfile.SoundFile:
    """Open a file that `open_audio` has accepted, at its beginning.

    The file is passed by number, since libsndfile heeds the suffix of a name, which says nothing for sure.
    """
    return soundfile.SoundFile(os.open(path, os.O_RDONLY), closefd=True)


def _open(path: Path, *, allow_truncated: bool) -> soundfile.SoundFile:
    try:
        with path.open("rb") as file:
            samples = _samples_in(file)
            if samples is None or not _is_unfinished(file, samples):
                return reopened(path)
            if not allow_truncated:
                given = f"file {path} (its recorder ended before it wrote the length)"
                raise InputError(given, "a whole file", READ_ANYWAY)
            content: Any = _finished(file, samples)  # which soundfile takes, as it has what a file has
            return soundfile.SoundFile(content)
    except soundfile.LibsndfileError as error:
        raise _unreadable(path) from error
    except OSError as error:
        raise InputError(f"file {path} ({error.strerror})", "a readable sound file") from error


def _unreadable(path: Path) -> InputError:
    """Return the error for a file that libsndfile does not read, with the line that converts it."""
    with path.open("rb") as file:
        first = file.read(12)
    kinds = (name for magic, name in NEED_CONVERSION.items() if magic in (first[: len(magic)], first[4:8]))
    kind = next(kinds, "")
    suffix = ".flac" if path.suffix.lower() == ".wav" else ".wav"
    convert = f"convert it: ffmpeg -i {quote(str(path))} {quote(str(path.with_suffix(suffix)))}"
    given = f"file {path} ({kind or f'begins with {first[:4]!r}'})"
    return InputError(given, f"whole sound as {READABLE}", convert if kind else "")


def _refuse(file: soundfile.SoundFile, path: Path, max_channels: int) -> None:
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
    with path.open("rb") as raw:
        whole = _is_complete(raw)
    if not (whole and _last_frame_reads(path)):
        raise InputError(f"file {path} (truncated)", "a whole file", f"copy it again, or {READ_ANYWAY}")


def _last_frame_reads(path: Path) -> bool:
    """Return whether the last frame that the file states can be read."""
    with reopened(path) as file:  # after a jump, an mp3 reads a little differently
        try:
            file.seek(file.frames - 1)
            return len(file.read(1)) == 1
        except soundfile.LibsndfileError:
            return False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Samples:
    """Where the samples of a wav or aiff file begin, and their size in bytes by its header.

    `order` is the byte order of its numbers; `wide` is the offset of an RF64 file's 64-bit lengths, else 0.
    """

    begin: int
    stated: int
    order: Literal["big", "little"]
    wide: int


def _samples_in(file: BinaryIO) -> _Samples | None:
    """Walk the chunks of a wav or aiff file to its samples; return None where there are none."""
    magic = _magic(file)
    if magic not in CHUNKED:
        return None
    order: Literal["big", "little"] = "big" if magic[:4] in (b"RIFX", b"FORM") else "little"
    file.seek(12)
    wide = 0
    while len(head := file.read(8)) == 8:
        length = int.from_bytes(head[4:], order)
        begin = file.tell()
        if head[:4] == b"ds64":
            wide = begin
        if head[:4] in (b"data", b"SSND"):
            if length == UNKNOWN_LENGTH and wide:
                file.seek(wide + 8)
                length = int.from_bytes(file.read(8), order)
            return _Samples(begin=begin, stated=length, order=order, wide=wide)
        file.seek(begin + length + length % 2)
    return None


def _magic(file: BinaryIO) -> bytes:
    """Return a file's first four bytes and those from byte 8."""
    file.seek(0)
    first = file.read(12)
    return first[:4] + first[8:]


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
    """Return whether a wav or aiff file has all its samples, and an ogg file its last page; others pass."""
    magic = _magic(file)
    if magic.startswith(b"OggS"):
        return _has_last_page(file)
    if magic not in CHUNKED:
        return True
    samples = _samples_in(file)
    if samples is None:
        return False
    unknown = samples.stated == UNKNOWN_LENGTH  # a program that writes to a pipe puts it
    return unknown or samples.begin + samples.stated <= _size(file)


def _has_last_page(file: BinaryIO) -> bool:
    """Return whether an ogg file ends with a whole page that is marked as its last."""
    file.seek(max(_size(file) - OGG_PAGE, 0))
    page = file.read()
    page = page[max(page.rfind(b"OggS"), 0) :]
    if len(page) < OGG_HEADER:
        return False
    end = OGG_HEADER + page[OGG_HEADER - 1]
    return page[5] & OGG_LAST > 0 and end + sum(page[OGG_HEADER:end]) <= len(page)
