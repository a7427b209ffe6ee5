"""What stands around the messages of a session: its opening and the metadata at its end."""

import hashlib
import json
import zlib
from io import BytesIO
from typing import TYPE_CHECKING, Any

from monochord.sessions import codec
from monochord.sessions.description import Description, SessionClock

if TYPE_CHECKING:
    from mcap.writer import Writer

FORMAT = "1"
BEGIN = "monochord"
"""Name of the metadata at the start."""
END = "monochord.end"
"""Name of the metadata where a session was closed."""
LIBRARY, PROFILE = "monochord", "ros2"
GUARD = "guard"
"""Name, among the values at the end, of the checksum of the others."""
MAX_FLIPPED = 2
"""Bytes of our header that may be damaged before it counts as another program's."""
TOTALS = "totals"
"""Name, among the values at the end, of a checksum of each topic's messages in any order."""
UNGUARDED = {"checksum", "sha256", "messages", "frames", "dropped", "gaps", "end"}
"""Values at the end of a session that was written before there was a guard."""


def begin(
    out: Any, description: Description, text: str, clock: SessionClock
) -> "tuple[Writer, dict[str, int]]":
    """Write what comes before the first message; `text` is the description as it is written.

    Returns the writer, whose chunks end where its `flush` says, and the number of each topic.
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
    """Return the first bytes of a session, up to and with its first chunk and the index of that."""
    out = BytesIO()
    writer, topics = begin(out, Description.load(text), text, clock)
    epoch = clock.epoch_ns
    data = codec.encode(codec.TEXT, data=text)
    writer.add_message(topics["/description"], log_time=epoch, data=data, publish_time=epoch, sequence=0)
    writer.flush()
    return out.getvalue()


def rewritten(header: bytes) -> bool:
    """Return whether the body of a file's header is another program's, rather than ours with flipped bits."""
    ours = b"".join(len(each).to_bytes(4, "little") + each.encode() for each in (PROFILE, LIBRARY))
    flipped = sum(a != b for a, b in zip(header, ours, strict=False))
    return len(header) != len(ours) or flipped > MAX_FLIPPED


def guarded(values: dict[str, str]) -> dict[str, str]:
    """Return values with a checksum of them."""
    return {**values, GUARD: str(zlib.crc32(json.dumps(values, sort_keys=True).encode()))}


def ending_is_sound(ending: dict[str, str]) -> bool:
    """Return whether the values at the end agree with their checksum."""
    rest = {name: value for name, value in ending.items() if name != GUARD}
    if set(ending) != UNGUARDED:
        return guarded(rest) == ending
    digests = ending["sha256"]
    return hashlib.sha256(digests.encode()).hexdigest() == ending.get("checksum")
