"""Scans an MCAP file for what is intact after truncation or damage, and for patches that mend the rest."""

import json
import re
import struct
import zlib
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple

from mcap.data_stream import RecordBuilder
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
)

from monochord.sessions import chunks, codec
from monochord.sessions._digest import Digest
from monochord.sessions._layout import (
    BEGIN,
    END,
    FORMAT,
    GUARD,
    RECOVERED,
    ending_is_sound,
    is_later,
    opening,
    rewritten,
)
from monochord.sessions._packing import unreadable
from monochord.sessions.description import SessionClock

UNREADABLE = "unreadable chunk"
"""Kind of damage that may be none: a compression that is not known here."""
_ORIGIN = re.compile(rb"origin.{4}([0-9.e+-]+)", re.DOTALL)

_TIMES = struct.Struct("<QQ")
"""First and last time in a chunk: its record begins with them, and no checksum guards them."""
Entries = dict[int, list[tuple[int, int]]]
"""Log time and offset of each channel's messages in a chunk."""


class Damage(NamedTuple):
    """A damaged byte range from `offset` to `end`: a chunk or another record (`what`)."""

    offset: int
    end: int
    what: str


class Patch(NamedTuple):
    """Bytes to write at `offset`, derived from the intact records around it; `what` is wrong there."""

    offset: int
    data: bytes
    what: str


@dataclass(slots=True)
class Contents:
    """A file's content: where its intact part ends, and the damage before that.

    `ended` means that an intact summary and footer follow, `closed` that traces of them do, `torn` that the
    file ends in an interrupted write with nothing usable. `damage` lists ranges that can only be left out;
    `patches` lists ranges that can be restored. `index` holds the message index of the last chunk where the
    file lacks it. `begin` and `ending` are the metadata at the beginning and the end; `text` and `epoch_ns`
    come from the description message; `digests` are by channel. `rewritten` means that another program wrote
    the file in its own layout; `marked` means that an earlier repair, complete or interrupted, left something
    out. `span` runs from the first log time to the last.
    """

    end: int = len(chunks.MAGIC)
    ended: bool = False
    closed: bool = False
    recovered: bool = False
    rewritten: bool = False
    marked: bool = False
    torn: bool = True
    damage: list[Damage] = field(default_factory=list[Damage])
    patches: list[Patch] = field(default_factory=list[Patch])
    index: bytes = b""
    begin: dict[str, str] = field(default_factory=dict[str, str])
    begin_at: Damage | None = None
    ending: dict[str, str] = field(default_factory=dict[str, str])
    ending_at: Damage | None = None
    text: str | None = None
    epoch_ns: int = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    digests: dict[int, Digest] = field(default_factory=lambda: defaultdict(Digest))
    span: tuple[int, int] | None = None

    @property
    def whole(self) -> bool:
        """Whether nothing needs repair.

        A Monochord session has an ending or the repair note; other programs leave that metadata out.
        """
        unmended = bool(self.damage or self.patches or (self.marked and not self.recovered))
        closed = bool(self.ending or self.recovered or self.rewritten or not self.begin)
        return self.ended and not unmended and closed

    @property
    def unreadable(self) -> bool:
        """Whether some chunks cannot be unpacked here although they may be intact."""
        return any(each.what == UNREADABLE for each in self.damage)

    @property
    def counts(self) -> dict[int, int]:
        """Number of messages in each channel."""
        return {number: each.count for number, each in self.digests.items()}

    def agrees(self) -> bool:
        """Return whether the messages match the checksums in the ending."""
        with suppress(ValueError):
            there = {c.topic: self.digests[n].ordered for n, c in self.channels.items()}
            return there == json.loads(self.ending.get("sha256", "{}"))
        return False


def scan(view: memoryview) -> Contents:
    """Return what a file holds up to its last intact record."""
    contents, edges, group = Contents(), set[int](), _ExpectedIndex()
    walked, data_ended = len(chunks.MAGIC), False
    records = chunks.records(view)
    for record in records:
        walked = record.end
        if isinstance(record.content, DataEnd):
            walked, data_ended = record.offset, True
            crc = record.content.data_section_crc
            contents.closed = crc in (0, zlib.crc32(view[: record.offset]))
            _add_summary(view, contents, record.end, list(records))
        elif record.opcode == chunks.FOOTER:
            walked, contents.closed = record.offset, True
        else:
            edges.add(record.end)
            if not group.takes(record):
                group.close(view, contents)
                group = _add(view, contents, record)
            elif group.full:
                group.close(view, contents)
    group.close(view, contents, last=not contents.closed and not data_ended)
    contents.closed = contents.closed or data_ended or bytes(view[-len(chunks.MAGIC) :]) == chunks.MAGIC
    contents.torn = chunks.torn(view, walked)
    _mend_opening(view, contents, edges)
    if contents.ending and contents.ending_at and not ending_is_sound(contents.ending):
        contents.damage.append(contents.ending_at._replace(what="ending"))
        contents.ending = {}
    return contents


def _add(view: memoryview, contents: Contents, record: chunks.Record) -> "_ExpectedIndex":
    """Add a record; return what must follow."""
    if record.opcode == chunks.CHUNK:
        return _add_chunk(view, contents, record)
    if isinstance(record.content, Metadata):
        _add_metadata(view, contents, record, record.content)
    elif isinstance(record.content, Attachment):
        _add_attachment(contents, record, record.content)
    elif record.opcode == chunks.DAMAGED:
        contents.damage.append(Damage(record.offset, record.end, "record"))
    else:
        contents.end = record.end
    if record.opcode == chunks.LOOSE:
        _add_messages(contents, record.body)
    contents.rewritten |= record.opcode == chunks.HEADER and rewritten(bytes(record.body))
    contents.marked |= record.opcode == chunks.LOST
    return _ExpectedIndex()


class _ExpectedIndex:
    """A chunk's message index: the expected index, and the records found in its place."""

    def __init__(self, chunk: ChunkIndex | None = None, start: int = 0, index: bytes = b"") -> None:
        self._chunk, self._bytes = chunk, index
        self._start = self._end = start

    @property
    def full(self) -> bool:
        return self._end - self._start == len(self._bytes)

    def takes(self, record: chunks.Record) -> bool:
        """Return whether a record is taken as part of the index; an index of an unknown chunk is skipped."""
        if self._chunk is None:
            return record.opcode == chunks.MESSAGE_INDEX
        if self.full or record.opcode not in (chunks.MESSAGE_INDEX, chunks.DAMAGED):
            return False
        self._end = record.end
        return True

    def close(self, view: memoryview, contents: Contents, *, last: bool = False) -> None:
        """Store the result in `contents`; where the file ends here, the index is appended to it."""
        chunk, self._chunk = self._chunk, None
        if chunk is None:
            return
        there = view[self._start : self._end]
        same = bytes(there) == self._bytes or _entries(there) == _entries(memoryview(self._bytes))
        if not same and self.full:
            _patch(view, contents, self._start, self._bytes)
            there = memoryview(self._bytes)
        if same or self.full:  # other programs write the same in another order
            contents.end = self._end
            chunk.message_index_length = len(there)
            chunk.message_index_offsets = chunks.index_offsets(there, self._start)
        elif last:
            contents.index = self._bytes
        elif self._end > self._start:
            contents.damage.append(Damage(self._start, self._end, "index"))


def _entries(index: memoryview) -> Entries | None:
    """Return the entries of an index; None if damaged."""
    entries: Entries = {}
    reached = 0
    for opcode, offset, body in chunks.inside(index):
        reached = offset + chunks.HEAD.size + len(body)
        content = chunks.parsed(opcode, body)
        if not isinstance(content, MessageIndex) or not chunks.index_fits(body):
            return None
        if content.records:
            entries.setdefault(content.channel_id, []).extend(content.records)
    return {number: sorted(each) for number, each in entries.items()} if reached == len(index) else None


def _patch(view: memoryview, contents: Contents, offset: int, data: bytes, what: str = "record") -> None:
    """Note the bytes expected at an offset, unless they are already there."""
    there = bytes(view[offset : offset + len(data)])
    if there == data:
        return
    wrong = [k for k, (is_, should) in enumerate(zip(there, data, strict=True)) if is_ != should]
    contents.patches.append(Patch(offset + wrong[0], data[wrong[0] : wrong[-1] + 1], what))


def _add_chunk(view: memoryview, contents: Contents, record: chunks.Record) -> _ExpectedIndex:
    """Add a chunk; return its expected index."""
    chunk = chunks.contents(record)
    if not chunk.sound:
        maybe = unreadable(chunk.compression, chunk.uncompressed_size)
        contents.damage.append(Damage(record.offset, record.end, UNREADABLE if maybe else "chunk"))
        return _ExpectedIndex()
    entries = _add_messages(contents, chunk.records)
    begin, stop = _span(entries) or (0, 0)
    if entries and not chunk.compression and not contents.rewritten:
        _patch(view, contents, record.offset + chunks.HEAD.size, _TIMES.pack(begin, stop))
    contents.end = record.end
    contents.chunks.append(
        ChunkIndex(
            chunk_length=record.end - record.offset,
            chunk_start_offset=record.offset,
            compression=chunk.compression,
            compressed_size=chunk.compressed_size,
            message_end_time=stop,
            message_index_length=0,
            message_index_offsets={},
            message_start_time=begin,
            uncompressed_size=chunk.uncompressed_size,
        )
    )
    index = RecordBuilder()
    for number, each in entries.items():
        MessageIndex(number, each).write(index)
    return _ExpectedIndex(contents.chunks[-1], record.end, index.end())


def _add_messages(contents: Contents, records: memoryview) -> Entries:
    """Add schemas, channels and messages; return the messages' offsets."""
    entries: Entries = {}
    for opcode, offset, body in chunks.inside(records):
        if opcode == chunks.MESSAGE and len(body) >= chunks.MIN_MESSAGE:
            message = chunks.message(body)
            entries.setdefault(message.channel, []).append((message.log_time, offset))
            contents.digests[message.channel].add(
                message.log_time, message.publish_time, message.sequence, message.data
            )
            channel = contents.channels.get(message.channel)
            if channel and channel.topic == "/description" and contents.text is None:
                contents.text, contents.epoch_ns = _text(message), message.log_time
        elif opcode in (chunks.SCHEMA, chunks.CHANNEL):
            content = chunks.parsed(opcode, body)
            if isinstance(content, Schema):
                contents.schemas[content.id] = content
            elif isinstance(content, Channel):
                contents.channels[content.id] = content
    if here := _span(entries):
        begin, stop = contents.span or here
        contents.span = min(begin, here[0]), max(stop, here[1])
    return entries


def _span(entries: Entries) -> tuple[int, int] | None:
    times = [time for each in entries.values() for time, _ in each]
    return (min(times), max(times)) if times else None


def _add_summary(view: memoryview, contents: Contents, begin: int, records: list[chunks.Record]) -> None:
    """Check the summary against its checksum (where it has one) and its position.

    A channel whose chunk is damaged is read from the summary; Monochord's channels are known without it.
    """
    footer = records[-1] if records else None
    if not footer or not isinstance(footer.content, Footer) or bytes(view[footer.end :]) != chunks.MAGIC:
        return
    start, crc = footer.content.summary_start, footer.content.summary_crc
    in_place = start == (0 if footer.offset == begin else begin)  # a summary of nothing begins nowhere
    contents.ended = contents.closed and in_place and crc in (0, zlib.crc32(view[begin : footer.end - 4]))
    for record in records if contents.rewritten and contents.ended else ():
        if isinstance(record.content, Schema):
            contents.schemas.setdefault(record.content.id, record.content)
        elif isinstance(record.content, Channel):
            contents.channels.setdefault(record.content.id, record.content)


def _text(message: chunks.Message) -> str | None:
    with suppress(Exception):  # whatever the decoder makes of what a program of another kind wrote
        return str(codec.decode(codec.TEXT, message.data).data)
    return None


def _add_metadata(view: memoryview, contents: Contents, record: chunks.Record, metadata: Metadata) -> None:
    name, content = metadata.name, metadata.metadata
    if len(name) == len(END) and GUARD in content and ending_is_sound(content):
        _patch(view, contents, record.offset + 13, END.encode())  # behind opcode and two lengths
        name = END
    if name == BEGIN:
        contents.begin, contents.begin_at = content, Damage(record.offset, record.end, "description")
    elif name == END:
        contents.ending, contents.ending_at = content, Damage(record.offset, record.end, "ending")
    contents.recovered = contents.recovered or name == RECOVERED
    contents.metadata.append(
        MetadataIndex(offset=record.offset, length=record.end - record.offset, name=name)
    )
    contents.end = record.end


def _add_attachment(contents: Contents, record: chunks.Record, attachment: Attachment) -> None:
    if int.from_bytes(record.body[-4:], "little") not in (0, zlib.crc32(record.body[:-4])):
        contents.damage.append(Damage(record.offset, record.end, "record"))
        return
    contents.attachments.append(
        AttachmentIndex(
            offset=record.offset,
            length=record.end - record.offset,
            create_time=attachment.create_time,
            log_time=attachment.log_time,
            data_size=len(attachment.data),
            name=attachment.name,
            media_type=attachment.media_type,
        )
    )
    contents.end = record.end


def _mend_opening(view: memoryview, contents: Contents, edges: set[int]) -> None:
    """Rebuild a damaged opening (everything before the second chunk) from the description, if it fits."""
    identity = identity_of(view, contents)
    if identity is None or contents.rewritten or is_later(contents.begin):
        return
    text, clock = identity
    try:
        made = opening(text, clock)
    except Exception:  # noqa: BLE001  (no description of ours: there is nothing to go by)
        return
    head = made[: next(chunks.records(memoryview(made))).end]
    headed = bytes(view[: len(head)]) == head
    described = contents.begin == {"format": FORMAT, **clock.dump(), "description": text}
    first = contents.chunks[0].chunk_start_offset if contents.chunks else len(made)
    if (
        headed
        and described
        and contents.text is not None
        and all(each.offset >= first for each in contents.damage)
    ):
        return
    if len(made) in edges:
        only_text = headed and contents.text is not None and bool(contents.begin)
        contents.damage = [each for each in contents.damage if each.offset >= len(made)]
        contents.patches = [each for each in contents.patches if each.offset >= len(made)]
        _patch(view, contents, 0, made, "description" if only_text else "begin")
        contents.end = max(contents.end, len(made))
        return
    if len(head) in edges:
        contents.damage = [each for each in contents.damage if each.offset >= len(head)]
        _patch(view, contents, 0, head, "begin")
    if not described and contents.begin_at:
        contents.damage.append(contents.begin_at)
        contents.begin = {}


def origin_of(view: memoryview, contents: Contents) -> float:
    """Return the monotonic clock at the session's beginning, 0 where it is lost (no time depends on it)."""
    written = _ORIGIN.search(view[: contents.chunks[0].chunk_start_offset if contents.chunks else 4096])
    for text in (
        contents.ending.get("origin") if ending_is_sound(contents.ending) else None,
        contents.begin.get("origin"),
        written and written[1].decode(),
    ):
        with suppress(ValueError, TypeError):
            if isfinite(origin := float(text or "")):
                return origin
    return 0.0


def identity_of(view: memoryview, contents: Contents) -> tuple[str, SessionClock] | None:
    """Return description and clock: from the checksummed message, else from the metadata at the start."""
    if contents.text is not None:
        return contents.text, SessionClock(epoch_ns=contents.epoch_ns, origin=origin_of(view, contents))
    with suppress(ValueError, KeyError):
        epoch_ns = int(contents.begin["epoch_ns"])
        return contents.begin["description"], SessionClock(
            epoch_ns=epoch_ns, origin=origin_of(view, contents)
        )
    return None
