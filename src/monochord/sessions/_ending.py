"""The ending of a repaired MCAP file: an index of what is whole in it."""

from typing import Any

from monochord.sessions._contents import Contents
from monochord.sessions.walk import MAGIC, RECOVERED


def ending_after(found: Contents, lost: int) -> bytes:
    """Return what belongs behind the whole part: the last chunk's index, a note, and the summary."""
    from mcap.data_stream import RecordBuilder  # noqa: PLC0415
    from mcap.opcode import Opcode  # noqa: PLC0415
    from mcap.records import (  # noqa: PLC0415
        DataEnd,
        Footer,
        MessageIndex,
        Metadata,
        MetadataIndex,
        Statistics,
        SummaryOffset,
    )

    out = RecordBuilder()
    for number, entries in found.last_index.items():
        before = out.count
        found.chunks[-1].message_index_offsets[number] = found.end + before
        MessageIndex(channel_id=number, records=entries).write(out)
        found.chunks[-1].message_index_length += out.count - before
    before = out.count
    Metadata(name=RECOVERED, metadata={"lost_bytes": str(lost)}).write(out)
    note = MetadataIndex(offset=found.end + before, length=out.count - before, name=RECOVERED)
    found.metadata.append(note)
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
    # A checksum of 0 says that there is none.
    Footer(summary_start=summary, summary_offset_start=offset_start, summary_crc=0).write(out)
    return out.end() + MAGIC
