"""Reads a session, whole, cut off or damaged."""

import json
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from monochord.errors import InputError
from monochord.sessions import codec, walk
from monochord.sessions._contents import END
from monochord.sessions._opening import BEGIN
from monochord.sessions.description import Description, SessionClock
from monochord.sessions.tracks import AudioTrack, ClockTrack, Event, LabelTrack, ReadingTrack
from monochord.sessions.writer import LABELS
from monochord.types import Feed


def read_session(path: Path) -> "Session":
    """Return a session, of which nothing but the description has been read yet.

    Raises
    ------
    InputError
        If there is no such file, or it is no session.
    """
    return Session(Path(path))


class Session:
    """A session on disk. What is asked for is read then, and kept.

    Attributes
    ----------
    path
        Its file.
    description
        What was recorded.
    clock
        Whose zero the times of all tracks count from.
    ending
        What was written when the session was closed; empty where it was cut off.
    recovered
        Whether it was cut off or damaged, and repaired.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._view = walk.mapped(path)
        self._names: dict[int, str] = {}
        self._chunks: list[memoryview] = []
        self._holes = 0
        told: dict[str, str] = {}
        self.ending: dict[str, str] = {}
        self.recovered = False
        for record in walk.records(self._view):
            if record.opcode == walk.METADATA:
                name, found = walk.metadata(record.body)
                told = found if name == BEGIN else told
                self.ending = found if name == END else self.ending
                self.recovered = self.recovered or name == walk.RECOVERED
            elif record.opcode == walk.CHUNK:
                self._chunks.append(record.body)
            elif record.opcode == walk.DAMAGED:
                self._holes += 1
            elif record.opcode == walk.DATA_END:
                break
        told = {**told, **self._told_again(told.get("origin", "0.0"))}
        if "description" not in told:
            remedy = "import audio and labels with: monochord sessions import"
            raise InputError(f"file {path} (MCAP, but no session)", "a session of Monochord", remedy)
        try:
            self.description = Description.load(told["description"])
            self.clock = SessionClock.load(told)
        except InputError:
            raise
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            given, remedy = (
                f"file {path} (its description is damaged)",
                "repair it: monochord sessions recover",
            )
            raise InputError(given, "a session of Monochord", remedy) from error
        # As every session numbers them; where the chunk that says so is damaged, this does.
        self._names = dict(enumerate(self.topics, 1))

    def _told_again(self, origin: str) -> dict[str, str]:
        """Return what the begin says, as the first message says it, which a checksum guards; else nothing."""
        names: dict[int, str] = {}
        held = walk.chunk(self._chunks[0]) if self._chunks else None
        for opcode, _, content in walk.inside(held.records) if held and held.sound else ():
            if opcode == walk.CHANNEL:
                channel = walk.channel(content)
                names[channel.id] = channel.topic
            elif opcode == walk.MESSAGE:
                message = walk.message(content)
                if names.get(message.channel) == "/description":
                    text = codec.decode(codec.TEXT, message.data).data
                    return {"description": text, "epoch_ns": str(message.log_time), "origin": origin}
        return {}

    @property
    def complete(self) -> bool:
        """Whether it was closed, rather than cut off."""
        return bool(self.ending)

    @cached_property
    def damaged(self) -> int:
        """How many chunks or other records are damaged; what they held is left out of all that is read."""
        return self._holes + sum(not walk.chunk(body).sound for body in self._chunks)

    @property
    def streams(self) -> tuple[str, ...]:
        """Names of the streams of readings; labels are none of them."""
        return tuple(feed.stream for feed in self.description.feeds if feed.stream != LABELS)

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of all topics, those of its streams among them."""
        return (*codec.TOPICS, *(codec.topic_of(stream) for stream in self.streams))

    def messages(self, topic: str) -> Iterator[walk.Message]:
        """Yield the messages of a topic in the order of the file; chunks that are damaged are left out."""
        for body in self._chunks:
            held = walk.chunk(body)
            for opcode, _, content in walk.inside(held.records) if held.sound else ():
                if opcode == walk.MESSAGE:
                    if self._names.get(int.from_bytes(content[:2], "little")) == topic:
                        yield walk.message(content)
                elif opcode == walk.CHANNEL:
                    found = walk.channel(content)
                    self._names[found.id] = found.topic

    @cached_property
    def audio(self) -> AudioTrack:
        """The microphones."""
        blocks = [(codec.decode(codec.AUDIO, message.data), message) for message in self.messages("/audio")]
        channels, rate = self.description.channels, self.description.sample_rate
        end = max((b.start + b.samples.size // channels for b, _ in blocks), default=0)
        samples = np.zeros((channels, end), dtype=np.float32)
        gaps: list[tuple[int, int]] = []
        timed: list[tuple[int, float, int]] = []
        reached = 0
        for block, message in blocks:
            part = block.samples.reshape(channels, -1)
            samples[:, block.start : block.start + part.shape[1]] = part
            if block.start > reached:
                gaps.append((reached, block.start))
            reached = max(reached, block.start + part.shape[1])
            if block.timed:
                timed.append((block.start, self.clock.seconds(message.log_time), block.frame_time))
        anchors = np.array(timed, dtype=np.float64).reshape(-1, 3)
        return AudioTrack(
            samples=samples,
            sample_rate=rate,
            gaps=tuple(gaps),
            anchor_frame=anchors[:, 0],
            anchor_time=anchors[:, 1],
            device_frame=anchors[:, 2].astype(np.int64),
        )

    def readings(self, stream: str) -> ReadingTrack:
        """Return a stream of readings; raises `InputError` where there is none of this name."""
        feed = self.description.feed(stream)
        messages = self.messages(codec.topic_of(stream))
        if codec.type_of(feed) == codec.POSES:
            return self._poses(feed, messages)
        found = [codec.decode(codec.type_of(feed), message.data) for message in messages]
        width = len(feed.columns)
        if codec.type_of(feed) == codec.WRENCHES:
            values = [np.hstack([m.force.reshape(-1, 3), m.torque.reshape(-1, 3)]) for m in found]
        else:
            values = [m.values.reshape(-1, width) for m in found]
        return ReadingTrack(
            feed=feed,
            time=self.clock.seconds(_joined([m.arrival for m in found], np.int64)),
            values=np.concatenate([np.zeros((0, width)), *values]),
            sequence=_joined([m.sequence for m in found], np.int64),
            device_time=_joined([m.device_time for m in found], np.int64),
            status=_joined([m.status for m in found], np.uint32),
        )

    @cached_property
    def labels(self) -> LabelTrack:
        """What is known to be true; without columns where nothing is."""
        found = [codec.decode(codec.LABELS, message.data) for message in self.messages("/labels")]
        names = list(dict.fromkeys(name for m in found for name in m.columns))
        columns: dict[str, list[Any]] = {name: [] for name in names}
        for m in found:
            values = m.values.reshape(len(m.time), -1)
            for name, parts in columns.items():
                given = name in m.columns
                unknown = np.full(len(m.time), np.nan)
                parts.append(values[:, m.columns.index(name)] if given else unknown)
        return LabelTrack(
            time=self.clock.seconds(_joined([m.time for m in found], np.int64)),
            columns={name: _joined(parts, np.float64) for name, parts in columns.items()},
        )

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """What happened, in order."""
        found = [codec.decode(codec.EVENT, message.data) for message in self.messages("/events")]
        events = [
            Event(
                time=float(self.clock.seconds(codec.nanoseconds(m.header.stamp))),
                kind=m.kind,
                text=m.text,
                data=json.loads(m.data or "{}"),
            )
            for m in found
        ]
        return tuple(sorted(events, key=lambda event: event.time))

    @cached_property
    def clocks(self) -> ClockTrack:
        """Offsets of this machine's clocks to the monotonic one."""
        found = [codec.decode(codec.CLOCKS, message.data) for message in self.messages("/clocks")]
        names = sorted({name for m in found for name in m.names})
        rows = [dict(zip(m.names, m.offsets.tolist(), strict=True)) for m in found]
        return ClockTrack(
            time=self.clock.seconds(np.array([codec.nanoseconds(m.header.stamp) for m in found], np.int64)),
            offsets={name: np.array([row.get(name, np.nan) for row in rows]) for name in names},
        )

    def _poses(self, feed: Feed, messages: Iterator[walk.Message]) -> ReadingTrack:
        arrivals: list[int] = []
        sequence: list[int] = []
        sent: list[int] = []
        values: list[tuple[float, ...]] = []
        for message in messages:
            stamp, pose = codec.decode_pose(message.data)
            arrivals.append(message.log_time)
            sequence.append(-1 if message.sequence == NO_COUNT else message.sequence)
            sent.append(stamp or -1)
            values.append(pose)
        return ReadingTrack(
            feed=feed,
            time=self.clock.seconds(np.array(arrivals, np.int64)),
            values=np.array(values, np.float64).reshape(-1, len(feed.columns)),
            sequence=np.array(sequence, np.int64),
            device_time=np.array(sent, np.int64),
            status=np.zeros(len(arrivals), np.uint32),
        )


NO_COUNT = (1 << 32) - 1
"""What stands for no sequence in a message's 32 bits."""


def _joined(parts: list[Any], kind: Any) -> Any:
    return np.concatenate([np.zeros(0, kind), *parts]).astype(kind, copy=False)
