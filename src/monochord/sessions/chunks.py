"""Walks an MCAP file: its records and chunks, and the messages in them, past any damage.

A session is a sequence of records; messages are records inside chunks, each chunk with a checksum. `records`
walks the file, from any damage to the next intact record; `contents` unpacks a chunk, and `inside` walks
that. `message_table` says where each topic's messages are, in reading order. Reader, check, repair and
writer walk a file by these alone.

The `mcap` library defines the record layout. This module unpacks only what is read for each chunk and
message, which takes a tenth of the time and no copy.
"""

import mmap
import re
import struct
import zlib
from array import array
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    Schema,
)
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.files import refuse_endless
from monochord.sessions import _packing as packing
from monochord.sessions import codec
from monochord.sessions.file import SessionFile, unreadable

MAX_WRITE = 8 << 20
"""Largest write, in bytes."""
MAGIC = b"\x89MCAP0\r\n"
# As plain numbers: a walk takes a quarter longer where it looks up members of the enumeration.
HEADER, FOOTER, DATA_END = int(Opcode.HEADER), int(Opcode.FOOTER), int(Opcode.DATA_END)
SCHEMA, CHANNEL, MESSAGE = int(Opcode.SCHEMA), int(Opcode.CHANNEL), int(Opcode.MESSAGE)
CHUNK, MESSAGE_INDEX = int(Opcode.CHUNK), int(Opcode.MESSAGE_INDEX)
METADATA, ATTACHMENT = int(Opcode.METADATA), int(Opcode.ATTACHMENT)
DAMAGED, LOOSE = 0, -1
"""Opcodes of `records` for damaged bytes and for messages outside chunks."""
FIRST_PRIVATE = 0x80
"""First opcode that MCAP reserves for applications."""
LOST, LOST_MARK = 0xDA, b"DAMAGED\n"
"""Opcode and first bytes of a record that replaces damaged ones; every reader skips it."""
HEAD = struct.Struct("<BQ")
"""Header of a record: opcode and length."""
CHUNK_HEAD = struct.Struct("<QQQII")
"""Header of a chunk: first and last time, size, checksum, length of the compression's name."""
_MESSAGE = struct.Struct("<HIQQ")
MIN_MESSAGE = _MESSAGE.size
"""Size of a message record without its payload, in bytes."""
_INDEX_HEAD, _INDEX_ENTRY = 6, 16
_LOOSE = (SCHEMA, CHANNEL, MESSAGE)
_MIN_DAMAGE = HEAD.size + len(LOST_MARK)  # bytes of the smallest damage, so that a record of opcode LOST fits
# Where a record may begin: an opcode of the data section, and a length below 4 GB.
_HEADS = re.compile(rb"(?=[\x02\x06\x07\x09\x0c\x0f\xda].{4}\x00{4})", re.DOTALL)
_LOOSE_HEADS = re.compile(rb"(?=[\x02-\x07\x09\x0c\x0f\xda].{4}\x00{4})", re.DOTALL)
_MAX_NAME = 32  # characters of a compression's name


class Record(NamedTuple):
    """A record of the file: opcode, begin and end offset, body, and the library's parsed content.

    For opcode `DAMAGED`, the body is the whole record, since its header is unknown. For `LOOSE`, it is one or
    more records (schemas, channels, messages) with headers, as `inside` reads them. `content` is None for
    these two, for chunks, messages, indices and `LOST`.
    """

    opcode: int
    offset: int
    end: int
    body: memoryview
    content: McapRecord | None = None


class Message(NamedTuple):
    """A message: channel number, sequence number, log and publish time in ns, payload."""

    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: memoryview


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkContents:
    """The records of a chunk, unpacked, and whether their checksum is right."""

    uncompressed_size: int
    compression: str
    compressed_size: int
    records: memoryview
    sound: bool


def mapped(path: Path) -> memoryview:
    """Return a file's bytes, mapped into memory; raises `InputError` if it is not an MCAP file."""
    refuse_endless(path)
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            view = (
                memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)) if size else memoryview(b"")
            )
    except OSError as error:
        raise unreadable(path, error) from error
    if bytes(view[: len(MAGIC)]) != MAGIC and not _record(view, len(MAGIC)):
        raise InputError(f"file {path} (not MCAP)", "a session (.mcap)", "record a session or import one")
    return view


def records(view: memoryview) -> Iterator[Record]:
    """Yield the records of a file up to its footer, or to where it was cut off.

    Where a record's header or inner lengths are damaged, the next intact record is searched; the bytes
    between form one record of opcode `DAMAGED`. Consecutive schemas, channels and messages outside chunks
    form one record of opcode `LOOSE`. After the data section nothing is searched: it is rebuilt from the data
    section.
    """
    offset, heads, before = len(MAGIC), _HEADS, HEADER
    while offset < len(view):
        record = _record(view, offset)
        if record is None:
            end = _next(view, offset + _MIN_DAMAGE, heads)
            if not end:
                return
            record = Record(DAMAGED, offset, end, view[offset:end])
        elif record.opcode in _LOOSE:
            if before in (CHUNK, MESSAGE_INDEX) and index_fits(record.body):
                record = record._replace(opcode=MESSAGE_INDEX, content=None)  # but for its opcode
            else:
                record, heads = _loose(view, record), _LOOSE_HEADS
        before, offset = record.opcode, record.end
        yield record
        if before == DATA_END:
            yield from _summary(view, offset)
        if before in (DATA_END, FOOTER):
            return


def torn(view: memoryview, offset: int) -> bool:
    """Return whether a file ends, from `offset` on, in an interrupted write with nothing complete."""
    if bytes(view[-len(MAGIC) :]) == MAGIC:
        return False
    data_end = _record(view, offset)
    if data_end and data_end.opcode == DATA_END:
        last = [data_end, *_summary(view, data_end.end)][-1]
        if last.opcode == FOOTER:
            return len(view) - last.end < len(MAGIC) and MAGIC.startswith(view[last.end :])
        offset = last.end
    rest = view[offset:]
    if len(rest) < HEAD.size or not any(rest):
        return True
    opcode, length = HEAD.unpack_from(rest)
    return HEADER <= opcode <= DATA_END and len(rest) - HEAD.size < length < MAX_WRITE


def contents(record: Record) -> ChunkContents:
    """Return the records of a chunk, empty where damaged; those of a `LOOSE` record have no checksum."""
    body = record.body
    if record.opcode == LOOSE:
        return ChunkContents(
            uncompressed_size=len(body),
            compression="",
            compressed_size=len(body),
            records=body,
            sound=True,
        )
    _, _, size, crc, length = CHUNK_HEAD.unpack_from(body)
    name = body[CHUNK_HEAD.size : CHUNK_HEAD.size + min(length, _MAX_NAME)]
    compression, packed = bytes(name).decode(errors="replace"), body[CHUNK_HEAD.size + length + 8 :]
    unpacked = packing.unpacked(compression, packed, size)
    whole = unpacked is not None and len(unpacked) == size
    return ChunkContents(
        uncompressed_size=size,
        compression=compression,
        compressed_size=len(packed),
        records=memoryview(b"") if unpacked is None else unpacked,
        sound=whole and (crc == 0 or zlib.crc32(unpacked or b"") == crc),
    )


def unpacked_size(record: Record) -> int:
    """Return the size that a chunk claims to unpack to, in bytes; 0 where it is not compressed."""
    if record.opcode == LOOSE:
        return 0
    _, _, size, _, length = CHUNK_HEAD.unpack_from(record.body)
    return size if length else 0


def inside(view: memoryview) -> Iterator[tuple[int, int, memoryview]]:
    """Yield opcode, offset and body of each record of a chunk."""
    offset = 0
    while offset + HEAD.size <= len(view):
        opcode, length = HEAD.unpack_from(view, offset)
        body = view[offset + HEAD.size : offset + HEAD.size + length]
        if len(body) < length:
            return
        yield opcode, offset, body
        offset += HEAD.size + length


def message(body: memoryview) -> Message:
    """Return the message in a record's body; a truncated one has only its channel."""
    if len(body) < MIN_MESSAGE:
        return Message(int.from_bytes(body[:2], "little"), 0, 0, 0, body[:0])
    number, sequence, log_time, publish_time = _MESSAGE.unpack_from(body, 0)
    return Message(number, sequence, log_time, publish_time, body[MIN_MESSAGE:])


def parsed(opcode: int, body: memoryview) -> McapRecord | None:
    """Return the library's parsed content of a record's body; None where its lengths are inconsistent."""
    if opcode not in _READ:
        return None
    stream = _Body(body)
    try:
        record = _READ[opcode](stream)
    except EndOfFile:
        return None
    if isinstance(record, (Channel, Metadata)):  # whose last length the library does not look at
        again = RecordBuilder()
        record.write(again)
        return record if again.end()[HEAD.size :] == bytes(body) else None
    return record if stream.count == len(body) else None


def messages_of(
    parts: list[Record], names: dict[int, str]
) -> Iterator[tuple[int, int, memoryview, str, Message]]:
    """Yield the messages of intact chunks: chunk number, offset in the chunk, body, topic, message.

    `names` maps known channels to topics, and gets those that the chunks name; other messages are left out.
    """
    for part, record in enumerate(parts):
        chunk = contents(record)
        for opcode, offset, body in inside(chunk.records) if chunk.sound else ():
            if opcode == CHANNEL:
                names |= named(parsed(opcode, body))
            elif opcode == MESSAGE:
                found = message(body)
                topic = names.get(found.channel)
                if topic is not None:
                    yield part, offset + HEAD.size, body, topic, found


def named(record: McapRecord | None) -> dict[int, str]:
    """Return the topic of a channel record, by channel number; nothing for another record."""
    return {record.id: record.topic} if isinstance(record, Channel) else {}


def message_table(
    parts: list[Record], names: dict[int, str], *, as_written: bool
) -> dict[str, NDArray[np.uint64]]:
    """Return, for each topic, rows (n, 4): sort key, chunk number, first and last byte within the chunk.

    `names` is as in `messages_of`. With `as_written`, rows keep recording order, in which a time may step
    back; otherwise they are sorted by log time. Audio is sorted by frame either way.
    """
    columns: dict[str, array[int]] = {}
    begin, end = 0, 0
    for part, start, body, topic, found in messages_of(parts, names):
        end = found.log_time or end
        begin = begin or end
        key = _sort_key(topic, found, as_written=as_written)
        columns.setdefault(topic, array("Q")).extend((key, part, start, start + len(body)))
    tables = {topic: np.frombuffer(each, np.uint64).reshape(-1, 4) for topic, each in columns.items()}
    return {topic: _sorted(rows, backwards=begin > end and not as_written) for topic, rows in tables.items()}


def _sort_key(topic: str, message: Message, *, as_written: bool) -> int:
    if topic == "/audio":  # a device's times may step back where its frames do not
        with suppress(InputError):
            return int(codec.decode(codec.AUDIO, message.data).start)
    return 0 if as_written else message.log_time


def _sorted(rows: NDArray[np.uint64], *, backwards: bool) -> NDArray[np.uint64]:
    """Return rows sorted by their first column; equal rows keep file order, or its reverse if that rises."""
    first, last = rows[0, 0], rows[-1, 0]
    rows = rows[::-1] if first > last or (first == last and backwards) else rows
    return rows[np.argsort(rows[:, 0], kind="stable")]


def index_offsets(index: memoryview, start: int) -> dict[int, int]:
    """Return the offset of each channel's record in a message index that starts at `start`."""
    return {int.from_bytes(body[:2], "little"): start + at for _, at, body in inside(index)}


class ChunkList:
    """Replaces the list in which an MCAP writer remembers its chunks until the file's end.

    An hour has some 36,000 chunks, whose entries take 22 MB in memory. This list stores each chunk's position
    and the size of its message index (16 bytes); the rest is read back when the end is written.
    """

    def __init__(self, file: SessionFile) -> None:
        self._file, self._positions, self._sizes = file, array("Q"), array("Q")

    def append(self, index: ChunkIndex) -> None:
        """Remember a written chunk with the message index after it."""
        self._positions.append(index.chunk_start_offset)
        self._sizes.append(index.message_index_length)

    def __iter__(self) -> Iterator[ChunkIndex]:
        return map(self._entry, self._positions, self._sizes)

    def _entry(self, begin: int, index_size: int) -> ChunkIndex:
        head = self._file.read(begin, HEAD.size + CHUNK_HEAD.size)
        end = begin + HEAD.size + HEAD.unpack_from(head)[1]
        first, last, size, _, _ = CHUNK_HEAD.unpack_from(head, HEAD.size)
        return ChunkIndex(
            chunk_start_offset=begin,
            chunk_length=end - begin,
            message_start_time=first,
            message_end_time=last,
            message_index_offsets=index_offsets(memoryview(self._file.read(end, index_size)), end),
            message_index_length=index_size,
            compression="",  # as a session is written
            compressed_size=size,
            uncompressed_size=size,
        )


class _Body(ReadDataStream):
    """A record's body: reading past its end raises, invalid UTF-8 does not."""

    def __init__(self, body: memoryview) -> None:
        super().__init__(BytesIO())
        self._body = body

    def read(self, length: int) -> bytes:
        part = self._body[self._count : self._count + length]
        if len(part) < length:
            raise EndOfFile
        self._count += length
        return bytes(part)

    def read_prefixed_string(self) -> str:
        return self.read(self.read4()).decode(errors="replace")


def _record(view: memoryview, offset: int) -> Record | None:
    """Return a record of the data section; None where its lengths are invalid."""
    if offset + HEAD.size > len(view):
        return None
    opcode, length = HEAD.unpack_from(view, offset)
    end = offset + HEAD.size + length
    if end > len(view):
        return None
    if (opcode == HEADER) != (offset == len(MAGIC)) and (opcode, offset) != (LOST, len(MAGIC)):
        return None
    body = view[offset + HEAD.size : end]
    if fits := _FITS.get(opcode):
        return Record(opcode, offset, end, body) if fits(body) else None
    content = parsed(opcode, body)
    return Record(opcode, offset, end, body, content) if content else None


def _loose(view: memoryview, first: Record) -> Record:
    """Return consecutive schemas, channels and messages as one record."""
    last = following = first
    while following and following.opcode in _LOOSE:
        last, following = following, _record(view, following.end)
    return Record(LOOSE, first.offset, last.end, view[first.offset : last.end])


def _next(view: memoryview, start: int, heads: "re.Pattern[bytes]") -> int:
    """Return where the next record begins that is intact or followed by a record; 0 where there is none.

    `heads` finds candidate positions: messages are searched only in files that have them outside chunks.
    """
    for match in heads.finditer(view, start):
        record = _record(view, match.start())
        if record is None:
            continue
        if record.opcode == FOOTER:
            follows = bytes(view[record.end :]) == MAGIC
        else:
            follows = len(view) - record.end < HEAD.size or _record(view, record.end) is not None
            follows = follows or (record.opcode == DATA_END and any(_summary(view, record.end)))
            follows = follows or (record.opcode == CHUNK and contents(record).sound)
        if follows:
            return record.offset
    return 0


def _summary(view: memoryview, offset: int) -> Iterator[Record]:
    """Yield the records after the data section, up to the footer or the first invalid one."""
    for opcode, at, body in inside(view[offset:]):
        if not HEADER <= opcode <= DATA_END and opcode < FIRST_PRIVATE:
            return
        begin = offset + at
        yield Record(opcode, begin, begin + HEAD.size + len(body), body, parsed(opcode, body))
        if opcode == FOOTER:
            return


def index_fits(body: memoryview) -> bool:
    """Return whether a record's body can be a message index."""
    return (
        len(body) % _INDEX_ENTRY == _INDEX_HEAD
        and int.from_bytes(body[2:_INDEX_HEAD], "little") == len(body) - _INDEX_HEAD
    )


def _chunk_fits(body: memoryview) -> bool:
    if len(body) < CHUNK_HEAD.size + 8:
        return False
    records = CHUNK_HEAD.size + CHUNK_HEAD.unpack_from(body)[-1]
    return records + 8 + int.from_bytes(body[records : records + 8], "little") == len(body)


_READ: dict[int, Callable[[ReadDataStream], McapRecord]] = {
    HEADER: Header.read,
    SCHEMA: Schema.read,
    CHANNEL: Channel.read,
    MESSAGE_INDEX: MessageIndex.read,
    METADATA: Metadata.read,
    ATTACHMENT: Attachment.read,
    DATA_END: DataEnd.read,
    FOOTER: Footer.read,
}
"""Parsers of a session's records."""
_FITS: dict[int, Callable[[memoryview], bool]] = {
    MESSAGE: lambda body: len(body) >= MIN_MESSAGE,
    CHUNK: _chunk_fits,
    MESSAGE_INDEX: index_fits,
    LOST: lambda body: bytes(body[: len(LOST_MARK)]) == LOST_MARK,
}
"""Length checks of the most frequent records."""
