"""Repairs a cut-off or damaged session in place: intact records stay, an ending is appended."""

import json
import mmap
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import DataEnd, Footer, Metadata, MetadataIndex, Statistics, SummaryOffset

from monochord.core.errors import InputError
from monochord.core.files import refuse_endless, synced, usable_path
from monochord.core.units import Seconds
from monochord.sessions import chunks
from monochord.sessions._layout import BEGIN, FORMAT, RECOVERED, opening, refuse_later
from monochord.sessions.file import refuse_recorded
from monochord.sessions.reader import read_session
from monochord.sessions.scan import Contents, identity_of, scan


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """The result of a repair: whether one was needed, and what remains.

    `seconds` is the length of the remaining audio. `lost_bytes` counts damaged or unfinished bytes that are
    now skipped. `cut` is the file with all bytes that were changed or removed; None where only an interrupted
    write was cut off.
    """

    path: Path
    repaired: bool
    messages: int
    seconds: Seconds
    lost_bytes: int
    cut: Path | None = None


def recover(path: Path) -> Recovery:
    """Repair a session in place; an intact session is not changed.

    Intact records stay in place, bit for bit. Everything that can be derived from them (the start, chunk
    headers, indices) is restored; anything else becomes a record that every reader skips. After the last
    intact record, the repair appends the index that every MCAP reader expects and a note that the session was
    repaired. It writes little more than an ending, so a full disk rarely prevents it. Before the repair, all
    bytes to be changed or removed, except an interrupted write, are saved beside the session as
    ``NAME.mcap.cut``; an existing file of that name stays.

    Raises
    ------
    InputError
        If the file does not exist, is not a session, has a later format, is being recorded, or cannot be
        written.
    """
    refuse_endless(path)
    with usable_path(f"file {path}", "a writable file"), path.open("r+b") as file:
        refuse_recorded(path, file.fileno())
        chunks.mapped(path)
        repair = _Repair(path, file)
        repair.plan()
        repair.carry_out()
    session = read_session(path)
    audio = session.audio
    return Recovery(
        path=path,
        repaired=repair.needed,
        messages=sum(repair.contents.counts.values()),
        seconds=audio.samples.shape[1] / audio.sample_rate,
        lost_bytes=repair.lost,
        cut=repair.cut,
    )


class _Repair:
    """The planned changes to a file, worked out on a private copy of its pages first.

    `contents` describes the file after the repair; `lost` counts the bytes that it loses.
    """

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self.cut: Path | None = None
        self._path, self._file = path, file
        self._draft = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY))
        self._changes: list[tuple[int, bytes]] = []
        self._pieces: list[tuple[int, int]] = []
        self.contents = scan(self._draft)
        self.lost = 0
        self.needed = not self.contents.whole

    def plan(self) -> None:
        """Work out the changes."""
        refuse_later(self._path, self.contents.begin)
        if self.contents.unreadable:
            given = f"session {self._path} (with chunks that cannot be unpacked here)"
            raise InputError(given, "chunks of lz4 or zstd, 64 MiB at most", "unpack it: mcap decompress")
        # What one look puts in place and the next takes away again is left after the second look.
        while fixes := [fix for fix in (*self._patches(), *self._damage()) if fix[:2] not in self._changes]:
            for offset, data, length in fixes:
                self._pieces.append((offset, offset + length))
                self._changes.append((offset, data))
                self._draft[offset : offset + len(data)] = data
            self.contents = scan(self._draft)
        size = len(self._draft)
        if not self.contents.whole:
            self.lost += 0 if self.contents.ending else size - self.contents.end
            if not self.contents.torn:
                self._pieces.append((self.contents.end, size))

    def carry_out(self) -> None:
        """Save the bytes to be removed, then change the file."""
        if not self.needed:
            return
        contents, file = self.contents, self._file
        ending = b"" if contents.whole else ending_after(contents, self._notes())
        if pieces := _joined(self._pieces):
            self.cut = _save_beside(self._path, [chunks.mapped(self._path)[a:b] for a, b in pieces])
        for offset, data in self._changes:
            file.seek(offset)
            file.write(data)
        if ending:
            file.flush()
            # What is not whole goes first: on a full disk its place is what the ending takes.
            file.truncate(contents.end)
            file.seek(contents.end)
            file.write(ending)
        file.flush()
        synced(file.fileno())

    def _patches(self) -> Iterator[tuple[int, bytes, int]]:
        for offset, data, _ in self.contents.patches:
            yield offset, data, len(data)

    def _damage(self) -> Iterator[tuple[int, bytes, int]]:
        contents = self.contents
        if contents.patches:
            return  # with these it may look otherwise
        for offset, end, _ in contents.damage:
            if offset < contents.end:
                self.lost += end - offset
                yield offset, _lost(end - offset), end - offset
        if (
            self.lost
            and contents.ending_at
            and contents.ending
            and not contents.damage
            and not contents.agrees()
        ):
            offset, end, _ = contents.ending_at  # its checksums are of more than is left
            yield offset, _lost(end - offset), end - offset

    def _notes(self) -> dict[str, dict[str, str]]:
        """Return the metadata to add; ensure that description, types and topics are known."""
        contents = self.contents
        identity = identity_of(self._draft, contents)
        if identity is None:
            remedy = "import audio and labels with: monochord sessions import"
            raise InputError(f"file {self._path} (MCAP, but not a session)", "a Monochord session", remedy)
        text, clock = identity
        notes = {RECOVERED: {"lost_bytes": str(self.lost), "pieces": json.dumps(_joined(self._pieces))}}
        if not contents.begin:
            notes[BEGIN] = {"format": FORMAT, **clock.dump(), "description": text}
        if not set(contents.counts) <= set(contents.channels) and not contents.rewritten:
            begin = scan(memoryview(opening(text, clock)))
            contents.schemas, contents.channels = begin.schemas, begin.channels
        return notes


def _lost(length: int) -> bytes:
    """Return the first bytes of a record that replaces `length` damaged bytes."""
    return chunks.HEAD.pack(chunks.LOST, length - chunks.HEAD.size) + chunks.LOST_MARK


def _joined(pieces: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return stretches in order, with overlapping ones merged."""
    merged: list[tuple[int, int]] = []
    for start, stop in sorted(pieces):
        if merged and start <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(stop, merged[-1][1])
        elif stop > start:
            merged.append((start, stop))
    return merged


def _save_beside(path: Path, pieces: Iterable[memoryview]) -> Path:
    """Save the bytes that a repair removes beside the file, under a free name."""
    for number in count(1):
        cut = path.with_name(f"{path.name}.cut{number if number > 1 else ''}")
        with suppress(FileExistsError), cut.open("xb") as file:
            try:
                for piece in pieces:
                    file.write(piece)
                file.flush()
                synced(file.fileno())
            except OSError:
                cut.unlink()
                raise
            return cut
    raise AssertionError


def ending_after(contents: Contents, notes: Mapping[str, Mapping[str, str]]) -> bytes:
    """Return the bytes after the intact part: the last chunk's index, notes by name, the summary."""
    out = RecordBuilder()
    if contents.index:
        contents.chunks[-1].message_index_length = len(contents.index)
        contents.chunks[-1].message_index_offsets = chunks.index_offsets(
            memoryview(contents.index), contents.end
        )
        out.write(contents.index)
    for name, values in notes.items():
        before = out.count
        Metadata(name=name, metadata=dict(values)).write(out)
        entry = MetadataIndex(offset=contents.end + before, length=out.count - before, name=name)
        contents.metadata.append(entry)
    DataEnd(0).write(out)
    begin, stop = contents.span or (0, 0)
    summary = contents.end + out.count
    groups: list[tuple[Opcode, list[Any]]] = [
        (Opcode.SCHEMA, list(contents.schemas.values())),
        (Opcode.CHANNEL, list(contents.channels.values())),
        (
            Opcode.STATISTICS,
            [
                Statistics(
                    attachment_count=len(contents.attachments),
                    channel_count=len(contents.channels),
                    channel_message_counts=contents.counts,
                    chunk_count=len(contents.chunks),
                    message_count=sum(contents.counts.values()),
                    message_end_time=stop,
                    message_start_time=begin,
                    metadata_count=len(contents.metadata),
                    schema_count=len(contents.schemas),
                )
            ],
        ),
        (Opcode.CHUNK_INDEX, list(contents.chunks)),
        (Opcode.ATTACHMENT_INDEX, list(contents.attachments)),
        (Opcode.METADATA_INDEX, list(contents.metadata)),
    ]
    groups_at: list[SummaryOffset] = []
    for opcode, entries in groups:
        start = contents.end + out.count
        for entry in entries:
            entry.write(out)
        if entries:
            length = contents.end + out.count - start
            groups_at.append(SummaryOffset(group_opcode=opcode, group_start=start, group_length=length))
    offset_start = contents.end + out.count
    for group in groups_at:
        group.write(out)
    Footer(summary_start=summary, summary_offset_start=offset_start, summary_crc=0).write(out)
    done = out.end()
    crc = zlib.crc32(done[summary - contents.end : -4])
    return done[:-4] + crc.to_bytes(4, "little") + chunks.MAGIC
