"""What is whole in an MCAP file, wherever it was cut off or damaged, and what would mend it."""

import json
import re
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple

from mcap.records import AttachmentIndex, Channel, ChunkIndex, MetadataIndex, Schema

from monochord.sessions import walk
from monochord.sessions._digest import Digest
from monochord.sessions._layout import ending_is_sound
from monochord.sessions.description import SessionClock

UNREADABLE = "unreadable chunk"
"""Kind of damage that may be none: a compression that is not known here."""
_ORIGIN = re.compile(rb"origin.{4}([0-9.e+-]+)", re.DOTALL)


class Damage(NamedTuple):
    """Bytes of a file that are not sound: a chunk or something else (`what`) from `offset` to `end`."""

    offset: int
    end: int
    what: str


class Patch(NamedTuple):
    """What belongs at `offset`, as what is sound around it says; `what` is wrong there."""

    offset: int
    data: bytes
    what: str


@dataclass(slots=True)
class Contents:
    """What a file holds, where its sound part ends, and what in that part is damaged.

    `ended` says that summary and footer follow and are sound, `closed` that there is a trace of them, `torn`
    that what follows is a writing that was cut off, of which nothing can be used. `damage` can only be left
    out, `patches` bring back all. `index` is of the last chunk's messages, where the file does not hold it.
    `begin` and `ending` are what the metadata at the beginning and the end say, `text` and `epoch_ns` what
    the description's message says; `digests` are by channel. `rewritten` says that another program, with a
    layout of its own, wrote the file; `marked` that a repair, perhaps one that was cut off, left something
    out. `span` is from the first log time to the last.
    """

    end: int = len(walk.MAGIC)
    ended: bool = False
    closed: bool = False
    recovered: bool = False
    rewritten: bool = False
    marked: bool = False
    torn: bool = True
    damage: list[Damage] = field(default_factory=list[Damage])
    patches: list[Patch] = field(default_factory=list[Patch])
    index: bytes = b""
    begin: dict[str, str] = field(default_factory=dict[str, str])
    begin_at: Damage | None = None
    ending: dict[str, str] = field(default_factory=dict[str, str])
    ending_at: Damage | None = None
    text: str | None = None
    epoch_ns: int = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    digests: dict[int, Digest] = field(default_factory=lambda: defaultdict(Digest))
    span: tuple[int, int] | None = None

    @property
    def whole(self) -> bool:
        """Whether there is nothing to mend.

        A session of ours has an ending, or the note that it was repaired; other programs leave metadata out.
        """
        unmended = bool(self.damage or self.patches or (self.marked and not self.recovered))
        closed = bool(self.ending or self.recovered or self.rewritten or not self.begin)
        return self.ended and not unmended and closed

    @property
    def unreadable(self) -> bool:
        """Whether there are chunks that cannot be unpacked here, and may be sound."""
        return any(each.what == UNREADABLE for each in self.damage)

    @property
    def counts(self) -> dict[int, int]:
        """Messages of each channel."""
        return {number: each.count for number, each in self.digests.items()}

    def agrees(self) -> bool:
        """Return whether the messages are those whose checksums the ending holds."""
        with suppress(ValueError):
            there = {c.topic: self.digests[n].ordered for n, c in self.channels.items()}
            return there == json.loads(self.ending.get("sha256", "{}"))
        return False


def origin_of(view: memoryview, contents: Contents) -> float:
    """Return the monotonic clock at a session's beginning, 0 where that is lost: no time depends on it."""
    written = _ORIGIN.search(view[: contents.chunks[0].chunk_start_offset if contents.chunks else 4096])
    for text in (
        contents.ending.get("origin") if ending_is_sound(contents.ending) else None,
        contents.begin.get("origin"),
        written and written[1].decode(),
    ):
        with suppress(ValueError, TypeError):
            if isfinite(origin := float(text or "")):
                return origin
    return 0.0


def identity_of(view: memoryview, contents: Contents) -> tuple[str, SessionClock] | None:
    """Return description and clock: as the message says, which a checksum guards, else as the start says."""
    if contents.text is not None:
        return contents.text, SessionClock(epoch_ns=contents.epoch_ns, origin=origin_of(view, contents))
    with suppress(ValueError, KeyError):
        epoch_ns = int(contents.begin["epoch_ns"])
        return contents.begin["description"], SessionClock(
            epoch_ns=epoch_ns, origin=origin_of(view, contents)
        )
    return None
