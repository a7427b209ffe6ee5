"""Looks a session over: is it whole, is it what was written, what is missing."""

import hashlib
import json
import struct
from dataclasses import dataclass
from pathlib import Path

from monochord.errors import InputError
from monochord.sessions import codec, walk
from monochord.sessions.description import Description
from monochord.sessions.reader import Session, read_session
from monochord.units import Seconds

DISTURBANCES = (
    "clock_step",
    "clock_doubt",
    "uncounted",
    "reconnect",
    "silent",
    "failed",
    "clipping",
    "nan",
    "disk_slow",
    "disk_low",
)
"""Kinds of events that a report counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What a look at a session found.

    `faults` make the file less than what was recorded: damage, a missing end, a checksum that is not right.
    `remarks` are what the recording itself says went wrong: lost frames, missing readings, a stepped clock.
    """

    path: Path
    seconds: Seconds
    checksum: str
    messages: dict[str, int]
    faults: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def sound(self) -> bool:
        """Whether the file is whole and as it was written."""
        return not self.faults


def check(path: Path) -> Report:
    """Read all of a session and say what is wrong with it.

    Raises
    ------
    InputError
        If the file is not there or no session at all.
    """
    faults = _structural(path)
    session = read_session(path)
    digests, messages = _digests(session)
    checksum = hashlib.sha256(json.dumps(digests, sort_keys=True).encode()).hexdigest()
    if not session.complete and not session.recovered:
        faults.append("was not closed; repair it: monochord sessions recover")
    elif session.complete and checksum != session.ending.get("checksum"):
        wrong = ", ".join(t for t, told in _written(session).items() if digests.get(t) != told)
        faults.append(f"checksum is not what was written ({wrong or 'its own is damaged'})")
    if not _described_twice(session):
        faults.append("its description is not what was written")
    audio = session.audio
    return Report(
        path=path,
        seconds=audio.samples.shape[1] / audio.sample_rate,
        checksum=checksum,
        messages=messages,
        faults=tuple(faults),
        remarks=tuple(_remarks(session)),
    )


def _structural(path: Path) -> list[str]:
    faults: list[str] = []
    view, end, footer = walk.mapped(path), len(walk.MAGIC), False
    damaged = 0
    for record in walk.records(view):
        end, footer = record.end, record.opcode == walk.FOOTER
        damaged += record.opcode == walk.CHUNK and not walk.chunk(record.body).sound
    if damaged:
        faults.append(f"{damaged} damaged chunk{'s' if damaged > 1 else ''}")
    if not footer:
        faults.append(f"cut off after {end} of {len(view)} bytes")
    elif bytes(view[end:]) != walk.MAGIC:
        faults.append("does not end as MCAP files do")
    return faults


def _written(session: Session) -> dict[str, str]:
    """Return SHA-256 of every topic as the writer told them, nothing where that is damaged."""
    try:
        return dict(json.loads(session.ending.get("sha256", "{}")))
    except ValueError:
        return {}


def _described_twice(session: Session) -> bool:
    """Return whether the description, which no checksum guards, is the one in the message, which one does."""
    told = [codec.decode(codec.TEXT, message.data).data for message in session.messages("/description")]
    return not told or Description.load(told[0]) == session.description


def _digests(session: Session) -> tuple[dict[str, str], dict[str, int]]:
    """Return SHA-256 and number of messages of every topic, as the writer reckons them."""
    digests, counts = {}, dict.fromkeys(session.topics, 0)
    for topic in session.topics:
        digest = hashlib.sha256()
        for message in session.messages(topic):
            digest.update(struct.pack("<QQI", message.log_time, message.publish_time, message.sequence))
            digest.update(message.data)
            counts[topic] += 1
        digests[topic] = digest.hexdigest()
    return digests, counts


def _remarks(session: Session) -> list[str]:
    remarks: list[str] = []
    audio = session.audio
    if session.recovered:
        remarks.append("was cut off and repaired")
    lost = sum(stop - first for first, stop in audio.gaps)
    if lost:
        gaps = len(audio.gaps)
        remarks.append(f"{lost} frames lost in {gaps} gap{'s' if gaps > 1 else ''}")
    for stream in session.streams:
        try:
            track = session.readings(stream)
        except (InputError, ValueError) as error:  # pragma: no cover  (a damaged message)
            remarks.append(f"{stream}: {error}")
            continue
        if not len(track.time):
            remarks.append(f"{stream}: no readings")
        if track.missing:
            remarks.append(f"{stream}: {track.missing} of {track.missing + len(track.time)} readings missing")
        if faulty := int((track.status != 0).sum()):
            remarks.append(f"{stream}: {faulty} readings with a fault")
    kinds = [event.kind for event in session.events]
    remarks += [f"{kinds.count(kind)} x {kind}" for kind in DISTURBANCES if kind in kinds]
    return remarks
