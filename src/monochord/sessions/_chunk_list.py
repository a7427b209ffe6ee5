"""The index of a session that is being written, kept where it lies already: in the file."""

import struct
from array import array
from collections.abc import Iterator
from typing import TYPE_CHECKING

from monochord.sessions.file import SessionFile
from monochord.sessions.walk import MESSAGE_INDEX

if TYPE_CHECKING:
    from mcap.records import ChunkIndex

_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")


class ChunkList:
    """Stands in for the list in which an MCAP writer remembers its chunks until the file's end.

    An hour has some 36,000 chunks, whose entries take 22 MB in memory. Eight bytes of each are kept here,
    where it begins; the rest is read back from the file when the end is written.
    """

    def __init__(self, file: SessionFile) -> None:
        self._file, self._begins = file, array("Q")

    def append(self, index: "ChunkIndex") -> None:
        """Remember a chunk that was written, with the indexes of its messages behind it."""
        self._begins.append(index.chunk_start_offset)

    def __iter__(self) -> "Iterator[ChunkIndex]":
        return map(self._entry, self._begins)

    def _entry(self, begin: int) -> "ChunkIndex":
        from mcap.records import ChunkIndex  # noqa: PLC0415

        body = begin + _HEAD.size
        _, length = _HEAD.unpack(self._file.read(begin, _HEAD.size))
        first, last, size, _, name = _CHUNK.unpack(self._file.read(body, _CHUNK.size))
        compression = self._file.read(body + _CHUNK.size, name).decode()
        end = at = body + length
        offsets: dict[int, int] = {}
        while len(head := self._file.read(at, _HEAD.size + 2)) > _HEAD.size:
            opcode, length_here = _HEAD.unpack_from(head)
            if opcode != MESSAGE_INDEX:
                break
            offsets[int.from_bytes(head[_HEAD.size :], "little")] = at
            at += _HEAD.size + length_here
        return ChunkIndex(
            chunk_start_offset=begin,
            chunk_length=end - begin,
            message_start_time=first,
            message_end_time=last,
            message_index_offsets=offsets,
            message_index_length=at - end,
            compression=compression,
            compressed_size=length - _CHUNK.size - name - 8,
            uncompressed_size=size,
        )
