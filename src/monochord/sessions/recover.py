"""Repairs a session that was cut off or damaged, in place: what is sound is kept, an ending put behind."""

import json
import mmap
import os
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, BinaryIO

from monochord.core.errors import InputError
from monochord.core.units import Seconds
from monochord.sessions import walk
from monochord.sessions._contents import Contents, contents, told_at_begin
from monochord.sessions._layout import BEGIN, FORMAT, opening
from monochord.sessions.file import refuse_recorded
from monochord.sessions.reader import read_session
from monochord.sessions.walk import MAGIC, inside


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """What became of a session: whether anything had to be done, and what was kept.

    `seconds` is the length of the audio. `lost_bytes` were damaged or unfinished and are read no more; `cut`
    is the file that keeps them and whatever else was changed, None where only a writing had been cut off.
    """

    path: Path
    repaired: bool
    messages: int
    seconds: Seconds
    lost_bytes: int
    cut: Path | None = None


def recover(path: Path) -> Recovery:
    """Repair a session in place; one that is whole is left as it is.

    Sound records stay where they are, bit for bit. What can be told from the rest (the begin, heads of
    chunks, indices) is put right; what cannot becomes a record that every reader skips. Behind the last sound
    record come the index that every MCAP reader looks for and a note that the session was repaired. Little
    more than an ending is written, so a full disk hardly matters. All bytes that are changed or cut away, but
    for a writing that was cut off, are first kept beside, as ``NAME.mcap.cut``; an older one stays.

    Raises
    ------
    InputError
        If the file is not there, no session, being recorded, or cannot be written.
    """
    try:
        with path.open("r+b") as file:
            refuse_recorded(path, file.fileno())
            walk.mapped(path)
            repair = _Repair(path, file)
            repair.plan()
            repair.carry_out()
    except OSError as error:
        raise InputError(f"file {path} ({error.strerror})", "a file that can be written") from error
    session = read_session(path)
    audio = session.audio
    return Recovery(
        path=path,
        repaired=repair.needed,
        messages=sum(repair.found.counts.values()),
        seconds=audio.samples.shape[1] / audio.sample_rate,
        lost_bytes=repair.lost,
        cut=repair.cut,
    )


class _Repair:
    """What is to be done to a file, worked out on a private copy of its pages before any of it is done.

    `found` is what the file will hold, `lost` how many of its bytes it will not.
    """

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self.cut: Path | None = None
        self._path, self._file = path, file
        self._draft = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY))
        self._changes: list[tuple[int, bytes]] = []
        self._pieces: list[tuple[int, int]] = []
        self.found = contents(self._draft)
        self.lost = 0
        self.needed = not self.found.whole

    def plan(self) -> None:
        """Work out what to change."""
        # What one look puts in place and the next takes away again is left after the second look.
        while fixes := [fix for fix in (*self._patches(), *self._damage()) if fix[:2] not in self._changes]:
            for offset, data, length in fixes:
                self._pieces.append((offset, offset + length))
                self._changes.append((offset, data))
                self._draft[offset : offset + len(data)] = data
            self.found = contents(self._draft)
        size = len(self._draft)
        if not self.found.whole:
            self.lost += 0 if self.found.ending else size - self.found.end
            if not self.found.torn:
                self._pieces.append((self.found.end, size))

    def carry_out(self) -> None:
        """Keep what will be gone, then change the file."""
        if not self.needed:
            return
        found, file = self.found, self._file
        ending = b"" if found.whole else ending_after(found, self._notes())
        if pieces := _joined(self._pieces):
            self.cut = _kept(self._path, [walk.mapped(self._path)[a:b] for a, b in pieces])
        for offset, data in self._changes:
            file.seek(offset)
            file.write(data)
        if ending:
            file.flush()
            # What is not whole goes first: on a full disk its place is what the ending takes.
            file.truncate(found.end)
            file.seek(found.end)
            file.write(ending)
        file.flush()
        os.fsync(file.fileno())

    def _patches(self) -> Iterator[tuple[int, bytes, int]]:
        for offset, data, _ in self.found.patches:
            yield offset, data, len(data)

    def _damage(self) -> Iterator[tuple[int, bytes, int]]:
        found = self.found
        if found.patches:
            return  # with these it may look otherwise
        for offset, end, _ in found.damage:
            if offset < found.end:
                self.lost += end - offset
                yield offset, walk.lost(end - offset), end - offset
        if self.lost and found.ending_at and found.ending and not found.damage and not found.agrees():
            offset, end, _ = found.ending_at  # its checksums are of more than is left
            yield offset, walk.lost(end - offset), end - offset

    def _notes(self) -> dict[str, dict[str, str]]:
        """Return the metadata to add; see to it that description, types and topics are known."""
        found = self.found
        told = told_at_begin(self._draft, found)
        if told is None:
            remedy = "import audio and labels with: monochord sessions import"
            raise InputError(f"file {self._path} (MCAP, but no session)", "a session of Monochord", remedy)
        text, clock = told
        notes = {walk.RECOVERED: {"lost_bytes": str(self.lost), "pieces": json.dumps(_joined(self._pieces))}}
        if not found.begin:
            notes[BEGIN] = {"format": FORMAT, **clock.dump(), "description": text}
        if not set(found.counts) <= set(found.channels):
            begin = contents(memoryview(opening(text, clock)))
            found.schemas, found.channels = begin.schemas, begin.channels
        return notes


def _joined(pieces: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return stretches in order, those that overlap as one."""
    found: list[tuple[int, int]] = []
    for start, stop in sorted(pieces):
        if found and start <= found[-1][1]:
            found[-1] = found[-1][0], max(stop, found[-1][1])
        elif stop > start:
            found.append((start, stop))
    return found


def _kept(path: Path, pieces: Iterable[memoryview]) -> Path:
    """Write what will be gone from a file beside it, under a name that is free."""
    for number in count(1):
        cut = path.with_name(f"{path.name}.cut{number if number > 1 else ''}")
        with suppress(FileExistsError), cut.open("xb") as file:
            try:
                for piece in pieces:
                    file.write(piece)
                file.flush()
                os.fsync(file.fileno())
            except OSError:
                cut.unlink()
                raise
            return cut
    raise AssertionError


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
