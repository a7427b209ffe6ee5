"""Walks an MCAP file record by record, as far as it is whole."""

import mmap
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from monochord.errors import InputError

if TYPE_CHECKING:
    from mcap.data_stream import ReadDataStream
    from mcap.records import Attachment, Channel, Schema

RECOVERED = "monochord.recovered"
"""Name of the metadata that a repaired session has."""
MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = 1, 2, 3, 4, 5, 6, 7
CHUNK_INDEX, ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX = 8, 9, 10, 11, 12, 13
SUMMARY_OFFSET, DATA_END = 14, 15
_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQII")


class Record(NamedTuple):
    """A record of the file: its opcode, where it begins and ends, and its body."""

    opcode: int
    offset: int
    end: int
    body: memoryview


class Message(NamedTuple):
    """A message: its channel's number, its count, when it was logged and published in ns, its payload."""

    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: memoryview


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkBody:
    """What a chunk holds: first and last log time, its records, and whether their checksum is right."""

    begin: int
    stop: int
    uncompressed_size: int
    compression: str
    compressed_size: int
    records: memoryview
    sound: bool


def mapped(path: Path) -> memoryview:
    """Return the bytes of a file, read as they are used; raises `InputError` if it is no MCAP file."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            view = (
                memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)) if size else memoryview(b"")
            )
    except OSError as error:
        raise InputError(f"file {path} ({error.strerror})", "a session (.mcap)", "check its name") from error
    if bytes(view[: len(MAGIC)]) != MAGIC:
        raise InputError(f"file {path} (not MCAP)", "a session (.mcap)", "record or import one")
    return view


def records(view: memoryview) -> Iterator[Record]:
    """Yield the records of a file up to its footer, or up to the first that was cut off."""
    offset = len(MAGIC)
    while offset + _HEAD.size <= len(view):
        opcode, length = _HEAD.unpack_from(view, offset)
        end = offset + _HEAD.size + length
        if end > len(view) or not HEADER <= opcode <= DATA_END:
            return
        yield Record(opcode, offset, end, view[offset + _HEAD.size : end])
        if opcode == FOOTER:
            return
        offset = end


def chunk(body: memoryview) -> ChunkBody:
    """Return what a chunk record holds, uncompressed; one that is damaged holds nothing."""
    begin, stop, size, crc, length = _CHUNK.unpack_from(bytes(body[: _CHUNK.size]).ljust(_CHUNK.size, b"\0"))
    compression = bytes(body[32 : 32 + length]).decode(errors="replace")
    packed = body[40 + length :]
    found = _unpacked(compression, packed, size)
    whole = len(body) >= _CHUNK.size + length + 8
    sound = whole and found is not None and len(found) == size and (crc == 0 or zlib.crc32(found) == crc)
    return ChunkBody(
        begin=begin,
        stop=stop,
        uncompressed_size=size,
        compression=compression,
        compressed_size=len(packed),
        records=memoryview(b"") if found is None else found,
        sound=sound,
    )


def inside(view: memoryview) -> Iterator[tuple[int, int, memoryview]]:
    """Yield opcode, offset and body of each record of a chunk."""
    offset = 0
    while offset + _HEAD.size <= len(view):
        opcode, length = _HEAD.unpack_from(view, offset)
        body = view[offset + _HEAD.size : offset + _HEAD.size + length]
        if len(body) < length:
            return
        yield opcode, offset, body
        offset += _HEAD.size + length


def message(body: memoryview) -> Message:
    """Return the message that a record's body holds."""
    number, sequence, log_time, publish_time = _MESSAGE.unpack_from(body, 0)
    return Message(number, sequence, log_time, publish_time, body[_MESSAGE.size :])


def schema(body: memoryview) -> "Schema":
    """Return the schema that a record's body holds."""
    from mcap.records import Schema  # noqa: PLC0415

    return Schema.read(_stream(body))


def channel(body: memoryview) -> "Channel":
    """Return the channel that a record's body holds."""
    from mcap.records import Channel  # noqa: PLC0415

    return Channel.read(_stream(body))


def attachment(body: memoryview) -> "Attachment | None":
    """Return the attachment that a record's body holds, None where it is damaged."""
    from mcap.records import Attachment  # noqa: PLC0415

    try:
        return Attachment.read(_stream(body))
    except Exception:  # noqa: BLE001  (whatever the library makes of damage)
        return None


def metadata(body: memoryview) -> tuple[str, dict[str, str]]:
    """Return name and content of a metadata record's body; of one that is damaged, an empty name."""
    from mcap.records import Metadata  # noqa: PLC0415

    try:
        found = Metadata.read(_stream(body))
    except Exception:  # noqa: BLE001  (whatever the library makes of damage)
        return "", {}
    return found.name, found.metadata


def _stream(body: memoryview) -> "ReadDataStream":
    from mcap.data_stream import ReadDataStream  # noqa: PLC0415

    return ReadDataStream(BytesIO(body))


def _unpacked(compression: str, packed: memoryview, size: int) -> memoryview | None:
    if not compression:
        return packed
    try:
        if compression == "zstd":
            import zstandard  # noqa: PLC0415

            return memoryview(zstandard.decompress(bytes(packed), max_output_size=size))
        if compression == "lz4":
            import lz4.frame  # noqa: PLC0415

            return memoryview(lz4.frame.decompress(bytes(packed)))
    except Exception:  # noqa: BLE001  (each library has errors of its own: damage)
        return None
    return None
