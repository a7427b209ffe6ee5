"""Checks a session: whether it is complete, unchanged since recording, and which data are missing."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.silence import is_silent
from monochord.core.units import Seconds
from monochord.sessions import chunks
from monochord.sessions._digest import Digest
from monochord.sessions._layout import TOTALS
from monochord.sessions.bounds import json_object
from monochord.sessions.description import Description
from monochord.sessions.file import being_written
from monochord.sessions.reader import SessionReader, read_session
from monochord.sessions.scan import UNREADABLE, Contents, scan
from monochord.sessions.tracks import AudioTrack

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
"""Event kinds counted in a report."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckReport:
    """The result of a check of a session.

    `content_checksum` is SHA-256 over the messages of all topics in order; it differs from the file's
    checksum. `faults` list damage to the file: damaged records, a missing end, a content checksum that
    differs. `remarks` list problems of the recording itself: lost frames, missing readings, a stepped clock.
    """

    path: Path
    seconds: Seconds
    content_checksum: str
    messages: dict[str, int]
    faults: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def sound(self) -> bool:
        """Whether the file is complete and unchanged since it was written."""
        return not self.faults


def check(path: Path) -> CheckReport:
    """Read a whole session and report its faults and remarks.

    Raises
    ------
    InputError
        If the file does not exist, is not a session, or has a later format.
    """
    recording = being_written(path)
    session = read_session(path)  # which refuses what would unpack to too much
    contents = scan(chunks.mapped(path))
    digests, messages = _by_topic(session, contents)
    content_checksum = hashlib.sha256(json.dumps(digests, sort_keys=True).encode()).hexdigest()
    faults = _damage(contents)
    if not contents.ended:
        where = f"cut off after {contents.end} of {path.stat().st_size} bytes: the session was never closed"
        faults += ["its ending is damaged"] if contents.closed else [] if recording else [where]
    if session.ending and content_checksum != session.ending.get("checksum"):
        wrong = ", ".join(t for t, digest in _ending(session, "sha256").items() if digests.get(t) != digest)
        faults.append(f"checksum differs from the recorded one ({wrong or 'its own is damaged'})")
    if not _described_twice(session):
        faults.append("its description differs from the recorded one")
    remarks = _remarks(session)
    if contents.ended and not (session.ending or session.recovered):
        remarks.insert(0, "its checksums are missing: it cannot be compared with the recording")
    faults += _malformed(session)
    if recording:
        faults.append("being recorded, or repaired by another program")
    elif not contents.whole and not contents.unreadable:
        faults.append("repair it: monochord sessions recover")
    audio = session.audio
    return CheckReport(
        path=path,
        seconds=audio.samples.shape[1] / audio.sample_rate,
        content_checksum=content_checksum,
        messages=messages,
        faults=tuple(faults),
        remarks=tuple(remarks),
    )


def _damage(contents: Contents) -> list[str]:
    """Return a sentence for each kind of damage."""
    faults: list[str] = []
    kinds = [each.what for each in (*contents.damage, *contents.patches)]
    if unreadable := kinds.count(UNREADABLE):
        faults.append(f"{unreadable} chunks that cannot be unpacked here: unpack it (mcap decompress)")
    chunks, records = kinds.count("chunk"), sum(kinds.count(what) for what in ("record", "index", "ending"))
    if chunks:
        faults.append(f"{chunks} damaged chunk{'s' if chunks > 1 else ''}")
    if records:
        faults.append(f"{records} damaged record{'s' if records > 1 else ''} beside chunks")
    if "begin" in kinds:
        faults.append("its beginning is damaged")
    if "description" in kinds:
        faults.append("its description differs from the recorded one")
    return faults


def _ending(session: SessionReader, name: str) -> dict[str, Any]:
    """Return the stored checksum of every topic; empty where the ending is damaged."""
    try:
        return json_object(session.ending.get(name, "{}"))
    except InputError:
        return {}


def _described_twice(session: SessionReader) -> bool:
    """Return whether the description at the start, which has no checksum, equals the checksummed message."""
    texts = [content.data for _, content in session.decoded("/description")]
    try:
        return not texts or Description.load(texts[0]).dump() == session.description.dump()  # NaN is itself
    except InputError:
        return False


def _malformed(session: SessionReader) -> list[str]:
    """Return a sentence for each topic with malformed messages."""
    _ = session.labels, session.clocks  # the rest has been read
    return [
        f"{count} malformed message{'s' if count > 1 else ''} of {topic} left out ({first})"
        for topic, (count, first) in session.malformed.items()
    ]


def _by_topic(session: SessionReader, contents: Contents) -> tuple[dict[str, str], dict[str, int]]:
    """Return SHA-256 and number of messages of every topic, computed as the writer does.

    The result equals the stored SHA-256 as long as the messages are unchanged, in any order.
    """
    written, totals = _ending(session, "sha256"), _ending(session, TOTALS)
    digests: dict[str, str] = {}
    messages: dict[str, int] = {}
    for topic in session.topics:
        numbers = [number for number, name in session.channels.items() if name == topic]
        # Several channels of one topic are one only as they are read.
        digest = contents.digests[numbers[0]] if len(numbers) == 1 else _in_order(session, topic)
        same = digest.ordered == written.get(topic)
        if topic in totals:
            same = digest.total == totals[topic]
        elif not same and topic in written:
            same = _in_order(session, topic).ordered == written[topic]
        digests[topic] = written[topic] if same and topic in written else digest.ordered
        messages[topic] = digest.count
    return digests, messages


def _in_order(session: SessionReader, topic: str) -> Digest:
    """Return the digest of a topic's messages in reading order; older sessions store only this one."""
    digest = Digest()
    for message in session.messages(topic):
        digest.add(message.log_time, message.publish_time, message.sequence, message.data)
    return digest


def _remarks(session: SessionReader) -> list[str]:
    remarks: list[str] = []
    audio = session.audio
    if session.recovered:
        remarks.append("was cut off or damaged, and repaired")
    lost = sum(stop - first for first, stop in audio.gaps)
    if lost:
        gaps = len(audio.gaps)
        remarks.append(f"{lost} frames lost in {gaps} gap{'s' if gaps > 1 else ''}")
    remarks += _silence(audio)
    for stream in session.streams:
        track = session.readings(stream)
        if not len(track.time):
            remarks.append(f"{stream}: no readings")
        if track.missing:
            remarks.append(f"{stream}: {track.missing} of {track.missing + len(track.time)} readings missing")
        if faulty := int((track.status != 0).sum()):
            remarks.append(f"{stream}: {faulty} readings with a fault")
    kinds = [event.kind for event in session.events]
    remarks += [f"{kinds.count(kind)} x {kind}" for kind in DISTURBANCES if kind in kinds]
    return remarks


def _silence(audio: AudioTrack) -> list[str]:
    """Return a remark where a microphone was silent for a second, or throughout a shorter session."""
    channels, count = audio.samples.shape
    size = min(audio.sample_rate, count)
    starts = range(0, count - size + 1, size) if count else ()
    silent = [0] * channels
    for start in starts:
        quiet = [is_silent(channel[start : start + size]) for channel in audio.samples]
        if any(quiet) and not any(first < start + size and start < stop for first, stop in audio.gaps):
            silent = [before + now for before, now in zip(silent, quiet, strict=True)]
    texts = [
        f"microphone {k + 1} for {pieces * size / audio.sample_rate:.1f} s"
        for k, pieces in enumerate(silent)
        if pieces
    ]
    return [f"silence: {', '.join(texts)} ({Reason.SILENCE.remedy})"] if texts else []
