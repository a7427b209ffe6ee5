"""The ending of a repaired MCAP file: an index of what is whole in it."""

import zlib
from collections.abc import Iterator, Mapping
from typing import Any

from monochord.sessions._contents import Contents
from monochord.sessions.walk import MAGIC, inside


def ending_after(found: Contents, notes: Mapping[str, Mapping[str, str]]) -> bytes:
    """Return what belongs behind the sound part: the last chunk's index, notes by name, the summary."""
    from mcap.data_stream import RecordBuilder  # noqa: PLC0415
    from mcap.opcode import Opcode  # noqa: PLC0415
    from mcap.records import (  # noqa: PLC0415
        DataEnd,
        Footer,
        Metadata,
        MetadataIndex,
        Statistics,
        SummaryOffset,
    )

    out = RecordBuilder()
    if found.index:
        found.chunks[-1].message_index_length = len(found.index)
        found.chunks[-1].message_index_offsets = dict(_offsets(found.index, found.end))
        out.write(found.index)
    for name, values in notes.items():
        before = out.count
        Metadata(name=name, metadata=dict(values)).write(out)
        entry = MetadataIndex(offset=found.end + before, length=out.count - before, name=name)
        found.metadata.append(entry)
    DataEnd(0).write(out)
    summary = found.end + out.count
    groups: list[tuple[Opcode, list[Any]]] = [
        (Opcode.SCHEMA, list(found.schemas.values())),
        (Opcode.CHANNEL, list(found.channels.values())),
        (
            Opcode.STATISTICS,
            [
                Statistics(
                    attachment_count=len(found.attachments),
                    channel_count=len(found.channels),
                    channel_message_counts=dict(found.counts),
                    chunk_count=len(found.chunks),
                    message_count=sum(found.counts.values()),
                    message_end_time=max((c.message_end_time for c in found.chunks), default=0),
                    message_start_time=min((c.message_start_time for c in found.chunks), default=0),
                    metadata_count=len(found.metadata),
                    schema_count=len(found.schemas),
                )
            ],
        ),
        (Opcode.CHUNK_INDEX, list(found.chunks)),
        (Opcode.ATTACHMENT_INDEX, list(found.attachments)),
        (Opcode.METADATA_INDEX, list(found.metadata)),
    ]
    offsets: list[SummaryOffset] = []
    for opcode, entries in groups:
        start = found.end + out.count
        for entry in entries:
            entry.write(out)
        if entries:
            length = found.end + out.count - start
            offsets.append(SummaryOffset(group_opcode=opcode, group_start=start, group_length=length))
    offset_start = found.end + out.count
    for offset in offsets:
        offset.write(out)
    Footer(summary_start=summary, summary_offset_start=offset_start, summary_crc=0).write(out)
    done = out.end()
    crc = zlib.crc32(done[summary - found.end : -4])
    return done[:-4] + crc.to_bytes(4, "little") + MAGIC


def _offsets(index: bytes, start: int) -> Iterator[tuple[int, int]]:
    """Yield channel and place of each record of an index of messages that is to stand at `start`."""
    for _, offset, body in inside(memoryview(index)):
        yield int.from_bytes(body[:2], "little"), start + offset
