"""Where each topic's messages are in a file, in reading order."""

from array import array
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from mcap.records import Channel, McapRecord
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.sessions import codec, walk


def places(
    parts: list[walk.Record], names: dict[int, str], *, as_written: bool
) -> dict[str, NDArray[np.uint64]]:
    """Return, for each topic, rows (n, 4): sort key, chunk number, first and last byte within the chunk.

    `names` maps known channels to topics; topics named in `parts` are added. With `as_written`, rows keep
    recording order, in which a time may step back; otherwise they are sorted by log time. Audio is sorted by
    frame either way.
    """
    found: dict[str, array[int]] = {}
    begin, end = 0, 0
    for part, opcode, start, content in records_of(parts):
        if opcode == walk.CHANNEL:
            names |= named(walk.parsed(opcode, content))
        elif opcode == walk.MESSAGE:
            message = walk.message(content)
            topic = names.get(message.channel)
            if topic is None:
                continue
            end = message.log_time or end
            begin = begin or end
            key = _key(topic, message, as_written=as_written)
            found.setdefault(topic, array("Q")).extend((key, part, start, start + len(content)))
    tables = {topic: np.frombuffer(each, np.uint64).reshape(-1, 4) for topic, each in found.items()}
    return {topic: _sorted(rows, backwards=begin > end and not as_written) for topic, rows in tables.items()}


def records_of(parts: list[walk.Record]) -> Iterator[tuple[int, int, int, memoryview]]:
    """Yield the records of intact chunks: chunk number, opcode, offset of the body, body."""
    for part, record in enumerate(parts):
        chunk = walk.contents(record)
        for opcode, offset, body in walk.inside(chunk.records) if chunk.sound else ():
            yield part, opcode, offset + walk.HEAD.size, body


def _key(topic: str, message: walk.Message, *, as_written: bool) -> int:
    """Return the sort key of a topic's messages."""
    if topic == "/audio":  # a device's times may step back where its frames do not
        with suppress(InputError):
            return int(codec.decode(codec.AUDIO, message.data).start)
    return 0 if as_written else message.log_time


def _sorted(rows: NDArray[np.uint64], *, backwards: bool) -> NDArray[np.uint64]:
    """Return rows sorted by their first column; equal rows keep file order, or its reverse if that rises."""
    first, last = rows[0, 0], rows[-1, 0]
    rows = rows[::-1] if first > last or (first == last and backwards) else rows
    return rows[np.argsort(rows[:, 0], kind="stable")]


def named(record: McapRecord | None) -> dict[int, str]:
    """Return the topic of a channel record, by channel number; nothing for another record."""
    return {record.id: record.topic} if isinstance(record, Channel) else {}
