"""Walks an MCAP file record by record, past damage to the next sound record."""

import mmap
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from monochord.core.errors import InputError
from monochord.core.files import refuse_endless, similar_name
from monochord.sessions import _packing as packing

if TYPE_CHECKING:
    from mcap.data_stream import ReadDataStream
    from mcap.records import Attachment, Channel, Schema

MAX_WRITE = 8 << 20
"""Bytes of one writing, at most."""
RECOVERED = "monochord.recovered"
"""Name of the metadata that a repaired session has."""
MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = 1, 2, 3, 4, 5, 6, 7
CHUNK_INDEX, ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX = 8, 9, 10, 11, 12, 13
SUMMARY_OFFSET, DATA_END = 14, 15
DAMAGED, LOOSE = 0, -1
"""Opcodes under which `records` gives bytes that are no record, and messages in no chunk."""
_LOOSE = (SCHEMA, CHANNEL, MESSAGE)
LOST, LOST_MARK = 0xDA, b"DAMAGED\n"
"""Opcode, one of those that MCAP leaves to applications, and first bytes of a record that stands where others
were damaged: every reader skips it."""
_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
HEAD_SIZE = _HEAD.size
"""Bytes before the body of a record."""
MIN_MESSAGE = _MESSAGE.size
"""Bytes of a message record without its payload."""
_CHUNK = struct.Struct("<QQQII")
_PLAIN = _CHUNK.size + 8  # where the records of a chunk without compression begin
_INDEX_HEAD, _INDEX_ENTRY = 6, 16
_MIN_DAMAGE = _HEAD.size + len(
    LOST_MARK
)  # bytes of the smallest damage, so that a record of opcode LOST fits
# Where a record may begin: an opcode of the data section, and a length below 4 GB.
_HEADS = re.compile(rb"(?=[\x02\x06\x07\x09\x0c\x0f\xda].{4}\x00{4})", re.DOTALL)
_LOOSE_HEADS = re.compile(rb"(?=[\x02-\x07\x09\x0c\x0f\xda].{4}\x00{4})", re.DOTALL)
_MAX_NAME = 32  # characters of a compression's name


class Record(NamedTuple):
    """A record of the file: its opcode, where it begins and ends, and its body.

    Of opcode `DAMAGED`, the body is all of it, as there is no telling a head from what follows. Of `LOOSE`,
    it is all of one or more records (schemas, channels, messages), heads included, as `inside` takes them.
    """

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
    refuse_endless(path)
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            view = (
                memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)) if size else memoryview(b"")
            )
    except OSError as error:
        remedy = similar_name(path) or "check its name"
        raise InputError(f"file {path} ({error.strerror})", "a session (.mcap)", remedy) from error
    if bytes(view[: len(MAGIC)]) != MAGIC and not _end(view, len(MAGIC)):
        raise InputError(f"file {path} (not MCAP)", "a session (.mcap)", "record or import one")
    return view


def records(view: memoryview) -> Iterator[Record]:
    """Yield the records of a file up to its footer, or up to where it was cut off.

    Where a record's head or the lengths inside it are damaged, the next sound record is searched, and what
    lies between is one record of opcode `DAMAGED`; or a chunk, if its checksum says that only its head is
    damaged. Schemas, channels and messages that follow each other outside chunks are one record of opcode
    `LOOSE`. What comes after the data section is not searched: it is made anew from what comes before.
    """
    offset, heads, before = len(MAGIC), _HEADS, HEADER
    while offset < len(view):
        if end := _end_of_loose(view, offset):
            body = view[offset + _HEAD.size : end]
            if before in (CHUNK, MESSAGE_INDEX) and index_fits(body):  # an index but for its opcode
                record = Record(MESSAGE_INDEX, offset, end, body)
            else:
                record, heads = Record(LOOSE, offset, end, view[offset:end]), _LOOSE_HEADS
        elif end := _end(view, offset):
            record = Record(view[offset], offset, end, view[offset + _HEAD.size : end])
        else:
            end = _next(view, offset + _MIN_DAMAGE, heads) or len(view)
            body = view[offset + _HEAD.size : end]
            if chunk(body).sound:
                record = Record(CHUNK, offset, end, body)
            elif end < len(view):
                record = Record(DAMAGED, offset, end, view[offset:end])
            else:
                return
        before = record.opcode
        yield record
        if record.opcode == DATA_END:
            yield from _summary(view, end)
        if record.opcode in (DATA_END, FOOTER):
            return
        offset = end


def lost(length: int) -> bytes:
    """Return the first bytes of a record that takes the place of `length` damaged bytes."""
    return _HEAD.pack(LOST, length - _HEAD.size) + LOST_MARK


def chunk_head(begin: int, stop: int, records: memoryview) -> bytes:
    """Return the first bytes of an uncompressed chunk, up to its records."""
    size = len(records)
    inner = _CHUNK.pack(begin, stop, size, zlib.crc32(records), 0)
    return _HEAD.pack(CHUNK, _PLAIN + size) + inner + size.to_bytes(8, "little")


def torn(view: memoryview, offset: int) -> bool:
    """Return whether a file ends, from `offset` on, within what was being written, with nothing whole."""
    if bytes(view[-len(MAGIC) :]) == MAGIC:
        return False
    end = _end(view, offset)
    if end and view[offset] == DATA_END:
        for record in _summary(view, end):
            end = record.end
            if record.opcode == FOOTER:
                return len(view) - end < len(MAGIC) and MAGIC.startswith(view[end:])
        offset = end
    rest = view[offset:]
    if len(rest) < _HEAD.size or not any(rest):
        return True
    opcode, length = _HEAD.unpack_from(rest)
    return HEADER <= opcode <= DATA_END and len(rest) - _HEAD.size < length < MAX_WRITE


def chunk(body: memoryview) -> ChunkBody:
    """Return what a chunk record holds, uncompressed; one that is damaged holds nothing."""
    begin, stop, size, crc, length = _CHUNK.unpack_from(bytes(body[: _CHUNK.size]).ljust(_CHUNK.size, b"\0"))
    compression = bytes(body[32 : 32 + min(length, _MAX_NAME)]).decode(errors="replace")
    packed = body[40 + length :]
    unpacked = packing.unpacked(compression, packed, size)
    whole = len(body) >= _CHUNK.size + length + 8
    sound = (
        whole and unpacked is not None and len(unpacked) == size and (crc == 0 or zlib.crc32(unpacked) == crc)
    )
    if not sound and _only_its_head_is_damaged(body[_PLAIN:], crc):
        unpacked, packed, compression = body[_PLAIN:], body[_PLAIN:], ""
        size, sound = len(unpacked), True
    return ChunkBody(
        begin=begin,
        stop=stop,
        uncompressed_size=size,
        compression=compression,
        compressed_size=len(packed),
        records=memoryview(b"") if unpacked is None else unpacked,
        sound=sound,
    )


def contents(record: Record) -> ChunkBody:
    """Return what a record of opcode `CHUNK` or `LOOSE` holds; nothing guards the latter."""
    if record.opcode == CHUNK:
        return chunk(record.body)
    size = len(record.body)
    return ChunkBody(
        begin=0,
        stop=0,
        uncompressed_size=size,
        compression="",
        compressed_size=size,
        records=record.body,
        sound=True,
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


def schema(body: memoryview) -> "Schema | None":
    """Return the schema that a record's body holds, None where it is damaged."""
    from mcap.records import Schema  # noqa: PLC0415

    try:
        return Schema.read(_stream(body))
    except Exception:  # noqa: BLE001  (whatever the library makes of damage)
        return None


def channel(body: memoryview) -> "Channel | None":
    """Return the channel that a record's body holds, None where it is damaged."""
    from mcap.records import Channel  # noqa: PLC0415

    try:
        return Channel.read(_stream(body))
    except Exception:  # noqa: BLE001  (whatever the library makes of damage)
        return None


def attachment(body: memoryview) -> "Attachment | None":
    """Return the attachment that a record's body holds, None where it is damaged."""
    from mcap.records import Attachment  # noqa: PLC0415

    try:
        return Attachment.read(_stream(body))
    except Exception:  # noqa: BLE001  (whatever the library makes of damage)
        return None


def metadata(body: memoryview) -> tuple[str, dict[str, str]]:
    """Return name and content of a metadata record's body; of one that is damaged, an empty name."""
    from mcap.data_stream import RecordBuilder  # noqa: PLC0415
    from mcap.records import Metadata  # noqa: PLC0415

    again = RecordBuilder()
    try:
        record = Metadata.read(_stream(body))
        record.write(again)
    except Exception:  # noqa: BLE001  (whatever the library makes of damage)
        return "", {}
    # A length that points behind the end is not noticed in reading.
    return (record.name, record.metadata) if again.end()[_HEAD.size :] == bytes(body) else ("", {})


def _end(view: memoryview, offset: int) -> int:
    """Return where a record of the data section ends, 0 where the lengths in it say that there is none."""
    if offset + _HEAD.size > len(view):
        return 0
    opcode, length = _HEAD.unpack_from(view, offset)
    first, end = offset + _HEAD.size, offset + _HEAD.size + length
    if end > len(view) or opcode not in _FITS:
        return 0
    if (opcode == HEADER) != (offset == len(MAGIC)) and (opcode, offset) != (LOST, len(MAGIC)):
        return 0
    try:
        return end if _FITS[opcode](view[first:end]) else 0
    except struct.error:  # a length inside points behind the record
        return 0


def _end_of_loose(view: memoryview, offset: int) -> int:
    """Return where schemas, channels and messages that follow each other end, 0 where there are none."""
    end = 0
    while offset < len(view) and view[offset] in _LOOSE and (offset := _end(view, offset)):
        end = offset
    return end


def _next(view: memoryview, start: int, heads: "re.Pattern[bytes]") -> int:
    """Return where the next record begins that is sound, or has a record behind it; 0 where there is none.

    `heads` finds where one may begin: messages are looked for only in files that have them outside chunks.
    """
    for match in heads.finditer(view, start):
        at = match.start()
        end = _end(view, at)
        if not end:
            continue
        if view[at] == FOOTER:
            follows = bytes(view[end:]) == MAGIC
        else:
            follows = len(view) - end < _HEAD.size or _end(view, end) > 0
            follows = follows or (view[at] == DATA_END and any(_summary(view, end)))
            follows = follows or (view[at] == CHUNK and chunk(view[at + _HEAD.size : end]).sound)
        if follows:
            return at
    return 0


def _summary(view: memoryview, offset: int) -> Iterator[Record]:
    """Yield the records behind the data section, up to the footer or the first that makes no sense."""
    while offset + _HEAD.size <= len(view):
        opcode, length = _HEAD.unpack_from(view, offset)
        end = offset + _HEAD.size + length
        if end > len(view) or not HEADER <= opcode <= DATA_END:
            return
        yield Record(opcode, offset, end, view[offset + _HEAD.size : end])
        if opcode == FOOTER:
            return
        offset = end


def _only_its_head_is_damaged(records: memoryview, crc: int) -> bool:
    """Return whether records are those that a checksum was made of.

    The checksum itself may have one bit flipped: less than 2^29 bytes in which one is flipped never
    have a checksum that differs by one bit, and any other damage has it once in 2^27.
    """
    if not records or crc.bit_count() < 2 or (zlib.crc32(records) ^ crc).bit_count() > 1:
        return False
    end = 0
    for _, offset, body in inside(records):
        end = offset + _HEAD.size + len(body)
    return end == len(records)


def _number(body: memoryview, at: int, form: str = "<I") -> int:
    return int(struct.unpack_from(form, body, at)[0])


def _header_fits(body: memoryview) -> bool:
    library = 4 + _number(body, 0)
    return library + 4 + _number(body, library) == len(body)


def _schema_fits(body: memoryview) -> bool:
    encoding = 6 + _number(body, 2)
    data = encoding + 4 + _number(body, encoding)
    return data + 4 + _number(body, data) == len(body)


def _channel_fits(body: memoryview) -> bool:
    encoding = 8 + _number(body, 4)
    content = encoding + 4 + _number(body, encoding)
    return content + 4 + _number(body, content) == len(body)


def _chunk_fits(body: memoryview) -> bool:
    records = _CHUNK.size + _number(body, _CHUNK.size - 4)
    return records + 8 + _number(body, records, "<Q") == len(body)


def index_fits(body: memoryview) -> bool:
    """Return whether a record's body can be that of an index of messages."""
    return (
        len(body) >= _INDEX_HEAD
        and _number(body, 2) == len(body) - _INDEX_HEAD
        and len(body) % _INDEX_ENTRY == _INDEX_HEAD
    )


def _metadata_fits(body: memoryview) -> bool:
    content = 4 + _number(body, 0)
    return content + 4 + _number(body, content) == len(body)


def _attachment_fits(body: memoryview) -> bool:
    media = 20 + _number(body, 16)
    data = media + 4 + _number(body, media)
    return data + 8 + _number(body, data, "<Q") + 4 == len(body)


_FITS: dict[int, Callable[[memoryview], bool]] = {
    HEADER: _header_fits,
    SCHEMA: _schema_fits,
    CHANNEL: _channel_fits,
    MESSAGE: lambda body: len(body) >= MIN_MESSAGE,
    CHUNK: _chunk_fits,
    MESSAGE_INDEX: index_fits,
    METADATA: _metadata_fits,
    ATTACHMENT: _attachment_fits,
    DATA_END: lambda body: len(body) == 4,
    FOOTER: lambda body: len(body) == 20,
    LOST: lambda body: bytes(body[: len(LOST_MARK)]) == LOST_MARK,
}
"""Whether the lengths inside a record agree with the record's own, by opcode: two witnesses for all but a
message."""


def _stream(body: memoryview) -> "ReadDataStream":
    from mcap.data_stream import ReadDataStream  # noqa: PLC0415

    return ReadDataStream(BytesIO(body))


def unpacked_size(body: memoryview) -> int:
    """Return how many bytes a chunk record claims to unpack to, 0 if it is not compressed."""
    head = bytes(body[: _CHUNK.size]).ljust(_CHUNK.size, b"\0")
    _, _, size, _, length = _CHUNK.unpack(head)
    return size if length else 0
