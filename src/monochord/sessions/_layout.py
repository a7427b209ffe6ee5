"""The records around a session's messages: its opening and the metadata at its end."""

import hashlib
import json
import zlib
from collections.abc import Mapping
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from monochord.core.errors import InputError
from monochord.sessions import codec
from monochord.sessions.description import Description, SessionClock

if TYPE_CHECKING:
    from mcap.writer import Writer

FORMAT = "1"
BEGIN = "monochord"
"""Name of the metadata at the start."""
END = "monochord.end"
"""Name of the metadata where a session was closed."""
RECOVERED = "monochord.recovered"
"""Name of the metadata in a repaired session."""
LIBRARY, PROFILE = "monochord", "ros2"
GUARD = "guard"
"""Key, among the closing values, of the checksum over the other values."""
MAX_FLIPPED = 2
"""Up to this many damaged bytes, a header counts as ours; beyond, as another program's."""
TOTALS = "totals"
"""Key, among the closing values, of each topic's order-independent checksum."""
UNGUARDED = {"checksum", "sha256", "messages", "frames", "dropped", "gaps", "end"}
"""Closing values of a session written by a version without that checksum."""


def begin(
    out: Any, description: Description, text: str, clock: SessionClock
) -> "tuple[Writer, dict[str, int]]":
    """Write everything before the first message; `text` is the description as JSON.

    Return the writer, whose chunks end at each `flush`, and the number of each topic.
    """
    from mcap.writer import CompressionType, Writer  # noqa: PLC0415

    writer = Writer(out, compression=CompressionType.NONE, chunk_size=1 << 62)
    writer.start(profile=PROFILE, library=LIBRARY)
    writer.add_metadata(BEGIN, {"format": FORMAT, **clock.dump(), "description": text})
    if description.plan:
        plan = description.plan.encode()
        writer.add_attachment(clock.epoch_ns, clock.epoch_ns, "plan.toml", "application/toml", plan)
    types = dict(codec.TOPICS)
    for feed in description.feeds:
        types.setdefault(codec.topic_of(feed.stream), codec.type_of(feed))
    schemas = {
        name: writer.register_schema(name, "ros2msg", codec.definition(name).encode())
        for name in dict.fromkeys(types.values())
    }
    return writer, {
        topic: writer.register_channel(topic, "cdr", schemas[name]) for topic, name in types.items()
    }


def opening(text: str, clock: SessionClock) -> bytes:
    """Return the first bytes of a session, through its first chunk and that chunk's index."""
    out = BytesIO()
    writer, topics = begin(out, Description.load(text), text, clock)
    epoch = clock.epoch_ns
    data = codec.encode(codec.TEXT, data=text)
    writer.add_message(topics["/description"], log_time=epoch, data=data, publish_time=epoch, sequence=0)
    writer.flush()
    return out.getvalue()


def is_later(begin: Mapping[str, str]) -> bool:
    """Return whether the metadata at the start of a session name a later format than this version's."""
    with suppress(ValueError):
        return tuple(map(int, begin.get("format", FORMAT).split("."))) > (int(FORMAT),)
    return False


def refuse_later(path: Path, begin: Mapping[str, str]) -> None:
    """Raise `InputError` for a session in a later format, which this version neither reads nor repairs."""
    if is_later(begin):
        given = f"session {path} (format {begin['format']}, written by a later version of Monochord)"
        raise InputError(given, f"format {FORMAT}", "install a newer version: the file is left unchanged")


def rewritten(header: bytes) -> bool:
    """Return whether another program wrote the file's header, rather than our header having flipped bits."""
    ours = b"".join(len(each).to_bytes(4, "little") + each.encode() for each in (PROFILE, LIBRARY))
    flipped = sum(a != b for a, b in zip(header, ours, strict=False))
    return len(header) != len(ours) or flipped > MAX_FLIPPED


def guarded(values: dict[str, str]) -> dict[str, str]:
    """Return the values with a checksum of them added."""
    return {**values, GUARD: str(zlib.crc32(json.dumps(values, sort_keys=True).encode()))}


def ending_is_sound(ending: dict[str, str]) -> bool:
    """Return whether the values at the end agree with their checksum."""
    rest = {name: value for name, value in ending.items() if name != GUARD}
    if set(ending) != UNGUARDED:
        return guarded(rest) == ending
    digests = ending["sha256"]
    return hashlib.sha256(digests.encode()).hexdigest() == ending.get("checksum")
