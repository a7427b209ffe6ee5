"""Finds what is whole in an MCAP file, wherever it was cut off or damaged."""

import struct
import zlib
from contextlib import suppress
from typing import TYPE_CHECKING

from monochord.sessions import codec, walk
from monochord.sessions._contents import UNREADABLE, Contents, Damage, Patch, identity_of
from monochord.sessions._layout import BEGIN, END, FORMAT, GUARD, ending_is_sound, opening, rewritten
from monochord.sessions._packing import unreadable

if TYPE_CHECKING:
    from mcap.records import ChunkIndex

_INDEX = struct.Struct("<BQHI")
_ENTRY = struct.Struct("<QQ")
_INDEX_HEAD = 6


def scan(view: memoryview) -> Contents:
    """Return what a file holds up to its last sound record."""
    contents, edges, group = Contents(), set[int](), _Group()
    walked, data_end = len(walk.MAGIC), 0
    for record in walk.records(view):
        if data_end:
            _add_summary(contents, record)
            continue
        walked = record.end
        if record.opcode == walk.DATA_END:
            data_end = walked = record.offset
            crc = int.from_bytes(record.body, "little")
            contents.closed = crc in (0, zlib.crc32(view[: record.offset]))
            contents.ended = contents.closed and _summary_is_sound(view, data_end)
            continue
        if record.opcode == walk.FOOTER:
            walked, contents.closed = record.offset, True
            break
        edges.add(record.end)
        if group.takes(record):
            if group.full:
                group.close(view, contents)
            continue
        group.close(view, contents)
        group = _add(view, contents, record)
    group.close(view, contents, last=not contents.closed and not data_end)
    contents.closed = contents.closed or data_end > 0 or bytes(view[-len(walk.MAGIC) :]) == walk.MAGIC
    contents.torn = walk.torn(view, walked)
    _mend_opening(view, contents, edges)
    if contents.ending and contents.ending_at and not ending_is_sound(contents.ending):
        contents.damage.append(contents.ending_at._replace(what="ending"))
        contents.ending = {}
    return contents


def _add(view: memoryview, contents: Contents, record: walk.Record) -> "_Group":
    """Take a record in; return what must follow."""
    if record.opcode == walk.CHUNK:
        return _add_chunk(view, contents, record)
    if record.opcode == walk.METADATA:
        _add_metadata(view, contents, record)
    elif record.opcode == walk.ATTACHMENT:
        _add_attachment(contents, record)
    elif record.opcode == walk.DAMAGED:
        contents.damage.append(Damage(record.offset, record.end, "record"))
    else:
        contents.end = record.end
    if record.opcode == walk.LOOSE:
        _add_messages(contents, record.body)
    contents.rewritten |= record.opcode == walk.HEADER and rewritten(bytes(record.body))
    contents.marked |= record.opcode == walk.LOST
    return _Group()


class _Group:
    """A chunk's index of messages: what it must be, and the records that stand in its place."""

    def __init__(
        self, chunk: "ChunkIndex | None" = None, start: int = 0, index: dict[int, bytes] | None = None
    ) -> None:
        self._chunk, self._index = chunk, index or {}
        self._start = self._end = start
        self._bytes = b"".join(self._index.values())

    @property
    def full(self) -> bool:
        return self._end - self._start == len(self._bytes)

    def takes(self, record: walk.Record) -> bool:
        """Take a record that stands where an index should; one of no chunk that is known is passed over."""
        if self._chunk is None:
            return record.opcode == walk.MESSAGE_INDEX
        if self.full or record.opcode not in (walk.MESSAGE_INDEX, walk.DAMAGED):
            return False
        self._end = record.end
        return True

    def close(self, view: memoryview, contents: Contents, *, last: bool = False) -> None:
        """Enter the result into `contents`; where the file ends here, the index belongs behind."""
        chunk, self._chunk = self._chunk, None
        if chunk is None:
            return
        if _entries(view[self._start : self._end]) == _entries(memoryview(self._bytes)):
            contents.end = self._end  # other programs write the same in another order
            chunk.message_index_length = self._end - self._start
            chunk.message_index_offsets = offsets(view[self._start : self._end], self._start)
        elif self.full:
            _patch(view, contents, self._start, self._bytes)
            contents.end = self._end
            chunk.message_index_length = len(self._bytes)
            chunk.message_index_offsets = offsets(memoryview(self._bytes), self._start)
        elif last:
            contents.index = self._bytes
        elif self._end > self._start:
            contents.damage.append(Damage(self._start, self._end, "index"))


def _entries(index: memoryview) -> dict[int, list[tuple[int, int]]] | None:
    """Return times and places of the messages of each channel, as an index has them; None if damaged."""
    entries: dict[int, list[tuple[int, int]]] = {}
    reached = 0
    for opcode, offset, body in walk.inside(index):
        reached = offset + walk.HEAD_SIZE + len(body)
        if opcode != walk.MESSAGE_INDEX or not walk.index_fits(body):
            return None
        if body[_INDEX_HEAD:]:
            number = int.from_bytes(body[:2], "little")
            entries.setdefault(number, []).extend(_ENTRY.iter_unpack(body[_INDEX_HEAD:]))
    return {number: sorted(each) for number, each in entries.items()} if reached == len(index) else None


def offsets(index: memoryview, start: int) -> dict[int, int]:
    """Return the place of each channel's record in an index of messages that stands at `start`."""
    return {int.from_bytes(body[:2], "little"): start + at for _, at, body in walk.inside(index)}


def _patch(view: memoryview, contents: Contents, offset: int, data: bytes, what: str = "record") -> None:
    """Note what belongs at an offset, as far as it is not there."""
    there = bytes(view[offset : offset + len(data)])
    if there == data:
        return
    wrong = [k for k, (is_, should) in enumerate(zip(there, data, strict=True)) if is_ != should]
    contents.patches.append(Patch(offset + wrong[0], data[wrong[0] : wrong[-1] + 1], what))


def _add_chunk(view: memoryview, contents: Contents, record: walk.Record) -> _Group:
    """Take a chunk in; return what its index must be."""
    from mcap.records import ChunkIndex  # noqa: PLC0415

    chunk = walk.chunk(record.body)
    if not chunk.sound:
        maybe = unreadable(chunk.compression, chunk.uncompressed_size)
        contents.damage.append(Damage(record.offset, record.end, UNREADABLE if maybe else "chunk"))
        return _Group()
    entries = _add_messages(contents, chunk.records)
    begin, stop = _span(entries) or (0, 0)
    if not chunk.compression and entries and any(record.body[24:28]) and not contents.rewritten:
        _patch(view, contents, record.offset, walk.chunk_head(begin, stop, chunk.records))
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
    index = {
        number: _INDEX.pack(walk.MESSAGE_INDEX, 6 + 16 * len(each), number, 16 * len(each))
        + b"".join(_ENTRY.pack(*entry) for entry in each)
        for number, each in entries.items()
    }
    return _Group(contents.chunks[-1], record.end, index)


def _add_messages(contents: Contents, records: memoryview) -> dict[int, list[tuple[int, int]]]:
    """Take schemas, channels and messages in; return log times and places of the messages of each channel."""
    entries: dict[int, list[tuple[int, int]]] = {}
    for opcode, offset, body in walk.inside(records):
        if opcode == walk.SCHEMA:
            schema = walk.schema(body)
            contents.schemas |= {schema.id: schema} if schema else {}
        elif opcode == walk.CHANNEL:
            channel = walk.channel(body)
            contents.channels |= {channel.id: channel} if channel else {}
        elif opcode == walk.MESSAGE and len(body) >= walk.MIN_MESSAGE:
            message = walk.message(body)
            entries.setdefault(message.channel, []).append((message.log_time, offset))
            contents.digests[message.channel].add(
                message.log_time, message.publish_time, message.sequence, message.data
            )
            channel = contents.channels.get(message.channel)
            if channel and channel.topic == "/description" and contents.text is None:
                contents.text, contents.epoch_ns = _text(message), message.log_time
    if here := _span(entries):
        begin, stop = contents.span or here
        contents.span = min(begin, here[0]), max(stop, here[1])
    return entries


def _span(entries: dict[int, list[tuple[int, int]]]) -> tuple[int, int] | None:
    times = [time for each in entries.values() for time, _ in each]
    return (min(times), max(times)) if times else None


def _add_summary(contents: Contents, record: walk.Record) -> None:
    """Take in what only the summary tells, where the chunk that told it is damaged; ours is known without."""
    if not (contents.rewritten and contents.ended):
        return
    if record.opcode == walk.SCHEMA and (schema := walk.schema(record.body)):
        contents.schemas.setdefault(schema.id, schema)
    elif record.opcode == walk.CHANNEL and (channel := walk.channel(record.body)):
        contents.channels.setdefault(channel.id, channel)


def _text(message: walk.Message) -> str | None:
    with suppress(Exception):  # whatever the decoder makes of what a program of another kind wrote
        return str(codec.decode(codec.TEXT, message.data).data)
    return None


def _add_metadata(view: memoryview, contents: Contents, record: walk.Record) -> None:
    from mcap.records import MetadataIndex  # noqa: PLC0415

    name, content = walk.metadata(record.body)
    if not name:
        contents.damage.append(Damage(record.offset, record.end, "record"))
        return
    if len(name) == len(END) and GUARD in content and ending_is_sound(content):
        _patch(view, contents, record.offset + 13, END.encode())  # behind opcode and two lengths
        name = END
    if name == BEGIN:
        contents.begin, contents.begin_at = content, Damage(record.offset, record.end, "description")
    elif name == END:
        contents.ending, contents.ending_at = content, Damage(record.offset, record.end, "ending")
    contents.recovered = contents.recovered or name == walk.RECOVERED
    contents.metadata.append(
        MetadataIndex(offset=record.offset, length=record.end - record.offset, name=name)
    )
    contents.end = record.end


def _add_attachment(contents: Contents, record: walk.Record) -> None:
    from mcap.records import AttachmentIndex  # noqa: PLC0415

    attachment, crc = walk.attachment(record.body), int.from_bytes(record.body[-4:], "little")
    if attachment is None or crc not in (0, zlib.crc32(record.body[:-4])):
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


def _summary_is_sound(view: memoryview, data_end: int) -> bool:
    """Return whether summary and footer are what their checksum, where there is one, and their places say."""
    footer = len(view) - len(walk.MAGIC) - 29
    if footer <= data_end or bytes(view[-len(walk.MAGIC) :]) != walk.MAGIC:
        return False
    opcode, length, start, _, crc = struct.unpack_from("<BQQQI", view, footer)
    begin = data_end + 13  # behind the end of the data; a summary of nothing begins nowhere
    if (opcode, length) != (walk.FOOTER, 20) or start != (0 if footer == begin else begin):
        return False
    return crc in (0, zlib.crc32(view[begin : footer + 25]))


def _mend_opening(view: memoryview, contents: Contents, edges: set[int]) -> None:
    """Where what comes before the second chunk is damaged, make it anew from the description, if it fits."""
    identity = identity_of(view, contents)
    if identity is None or contents.rewritten:
        return
    text, clock = identity
    try:
        made = opening(text, clock)
    except Exception:  # noqa: BLE001  (no description of ours: there is nothing to go by)
        return
    head = made[: next(walk.records(memoryview(made))).end]
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
