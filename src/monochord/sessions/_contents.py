"""Which parts of an MCAP file are intact after truncation or damage, and the patches that repair the rest."""

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
    """A damaged byte range from `offset` to `end`: a chunk or another record (`what`)."""

    offset: int
    end: int
    what: str


class Patch(NamedTuple):
    """Bytes to write at `offset`, derived from the intact records around it; `what` is wrong there."""

    offset: int
    data: bytes
    what: str


@dataclass(slots=True)
class Contents:
    """A file's content: where its intact part ends, and the damage before that.

    `ended` means that an intact summary and footer follow, `closed` that traces of them do, `torn` that the
    file ends in an interrupted write with nothing usable. `damage` lists ranges that can only be left out;
    `patches` lists ranges that can be restored. `index` holds the message index of the last chunk where the
    file lacks it. `begin` and `ending` are the metadata at the beginning and the end; `text` and `epoch_ns`
    come from the description message; `digests` are by channel. `rewritten` means that another program wrote
    the file in its own layout; `marked` means that an earlier repair, complete or interrupted, left something
    out. `span` runs from the first log time to the last.
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
        """Whether nothing needs repair.

        A Monochord session has an ending or the repair note; other programs leave that metadata out.
        """
        unmended = bool(self.damage or self.patches or (self.marked and not self.recovered))
        closed = bool(self.ending or self.recovered or self.rewritten or not self.begin)
        return self.ended and not unmended and closed

    @property
    def unreadable(self) -> bool:
        """Whether some chunks cannot be unpacked here although they may be intact."""
        return any(each.what == UNREADABLE for each in self.damage)

    @property
    def counts(self) -> dict[int, int]:
        """Number of messages in each channel."""
        return {number: each.count for number, each in self.digests.items()}

    def agrees(self) -> bool:
        """Return whether the messages match the checksums in the ending."""
        with suppress(ValueError):
            there = {c.topic: self.digests[n].ordered for n, c in self.channels.items()}
            return there == json.loads(self.ending.get("sha256", "{}"))
        return False


def origin_of(view: memoryview, contents: Contents) -> float:
    """Return the monotonic clock at the session's beginning, 0 where it is lost (no time depends on it)."""
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
    """Return description and clock: from the checksummed message, else from the metadata at the start."""
    if contents.text is not None:
        return contents.text, SessionClock(epoch_ns=contents.epoch_ns, origin=origin_of(view, contents))
    with suppress(ValueError, KeyError):
        epoch_ns = int(contents.begin["epoch_ns"])
        return contents.begin["description"], SessionClock(
            epoch_ns=epoch_ns, origin=origin_of(view, contents)
        )
    return None
