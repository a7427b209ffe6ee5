"""What is whole in an MCAP file, wherever it was cut off."""

from collections import defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from monochord.sessions import walk

if TYPE_CHECKING:
    from mcap.records import AttachmentIndex, Channel, ChunkIndex, MetadataIndex, Schema


@dataclass(slots=True)
class Contents:
    """What the whole part of a file holds, and where it ends.

    `last_index` is of the last chunk's messages, by channel, as far as the file does not hold their index.
    `damaged` are bytes of chunks before the end that are not sound; no index knows of them.
    """

    end: int = len(walk.MAGIC)
    ended: bool = False
    damaged: int = 0
    schemas: "dict[int, Schema]" = field(default_factory=dict)
    channels: "dict[int, Channel]" = field(default_factory=dict)
    chunks: "list[ChunkIndex]" = field(default_factory=list)
    attachments: "list[AttachmentIndex]" = field(default_factory=list)
    metadata: "list[MetadataIndex]" = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=lambda: defaultdict(int))
    last_index: dict[int, list[tuple[int, int]]] = field(default_factory=dict)


def contents(view: memoryview) -> Contents:
    """Return what a file holds up to its last sound record; what is damaged before that is passed over."""
    from mcap.records import MetadataIndex  # noqa: PLC0415

    found, damaged, sound = Contents(), 0, True
    for record in walk.records(view):
        if record.opcode == walk.FOOTER:
            tail = bytes(view[record.end : record.end + len(walk.MAGIC)])
            found.ended = tail == walk.MAGIC
            break
        if record.opcode == walk.CHUNK:
            sound = _add_chunk(found, record)
            damaged += 0 if sound else record.end - record.offset
        if record.opcode in (walk.CHUNK, walk.MESSAGE_INDEX) and not sound:
            continue
        if record.opcode == walk.MESSAGE_INDEX:
            _add_index(found, record)
        elif record.opcode == walk.METADATA:
            name, _ = walk.metadata(record.body)
            entry = MetadataIndex(offset=record.offset, length=record.end - record.offset, name=name)
            found.metadata.append(entry)
        elif record.opcode == walk.ATTACHMENT:
            found.attachments += _attachment(record)
        elif record.opcode not in (walk.HEADER, walk.CHUNK):
            continue
        found.end, found.damaged = record.end, damaged
    return found


def _add_chunk(found: Contents, record: walk.Record) -> bool:
    """Take a chunk in; return whether it is sound."""
    from mcap.records import ChunkIndex  # noqa: PLC0415

    held = walk.chunk(record.body)
    if not held.sound:
        return False
    found.last_index = defaultdict(list)
    for opcode, offset, body in walk.inside(held.records):
        if opcode == walk.SCHEMA:
            schema = walk.schema(body)
            found.schemas[schema.id] = schema
        elif opcode == walk.CHANNEL:
            channel = walk.channel(body)
            found.channels[channel.id] = channel
        elif opcode == walk.MESSAGE:
            message = walk.message(body)
            found.counts[message.channel] += 1
            found.last_index[message.channel].append((message.log_time, offset))
    found.chunks.append(
        ChunkIndex(
            chunk_length=record.end - record.offset,
            chunk_start_offset=record.offset,
            compression=held.compression,
            compressed_size=held.compressed_size,
            message_end_time=held.stop,
            message_index_length=0,
            message_index_offsets={},
            message_start_time=held.begin,
            uncompressed_size=held.uncompressed_size,
        )
    )
    return True


def _add_index(found: Contents, record: walk.Record) -> None:
    if not found.chunks:
        return
    number, chunk = int.from_bytes(record.body[:2], "little"), found.chunks[-1]
    chunk.message_index_offsets[number] = record.offset
    chunk.message_index_length += record.end - record.offset
    found.last_index.pop(number, None)


def _attachment(record: walk.Record) -> "list[AttachmentIndex]":
    from mcap.records import AttachmentIndex  # noqa: PLC0415

    held = walk.attachment(record.body)
    if held is None:
        return []
    return [
        AttachmentIndex(
            offset=record.offset,
            length=record.end - record.offset,
            create_time=held.create_time,
            log_time=held.log_time,
            data_size=len(held.data),
            name=held.name,
            media_type=held.media_type,
        )
    ]
