"""Reads a session, whether complete, cut off or damaged."""

from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from mcap.records import Metadata
from numpy.typing import NDArray

from monochord.core.errors import InputError, did_you_mean, required
from monochord.core.labels import LabelTrack
from monochord.core.notebook import html_table, lines
from monochord.core.ranges import checked
from monochord.core.types import Feed, Floats
from monochord.core.units import Seconds
from monochord.sessions import chunks, codec
from monochord.sessions._layout import BEGIN, END, RECOVERED, refuse_later, rewritten
from monochord.sessions._picture import tracks_plot
from monochord.sessions.bounds import (
    MAX_COLUMNS,
    MAX_DURATION,
    json_object,
    refuse_beyond_memory,
    refuse_unpacking,
)
from monochord.sessions.description import NANO, Description, SessionClock
from monochord.sessions.tracks import AUDIO, LABELS, AudioTrack, ClockTrack, Event, ReadingTrack

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


@checked
def read_session(path: str | Path) -> "SessionReader":
    """Open a session; reads only its description at first.

    Raises
    ------
    InputError
        If the file does not exist, is not a session, or has a later format.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> twin = ["groups=[{name='hold', grid=[1, 1], hold=0.3}]"]
    >>> session = mc.read_session(mc.collect("quick", mkdtemp(), settings=twin)[0].path)
    >>> session.streams, session.audio.samples.shape[0], session.description.material
    (('wrench', 'pose'), 2, 'plastic')
    """
    return SessionReader(Path(path))


class SessionReader:
    """A session on disk. A track is read when it is first used, and cached.

    Attributes
    ----------
    path
        The session's file.
    description
        The session's description.
    clock
        The session's clock; its zero is time 0 of all tracks.
    ending
        Metadata written on closing; empty where the session was cut off.
    recovered
        Whether the session was repaired after damage.
    malformed
        For each topic read so far: the number of malformed messages, and the error of the first. All reads
        leave malformed messages out.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> twin = ["groups=[{name='hold', grid=[1, 1], hold=0.3}]"]
    >>> session = mc.read_session(mc.collect("quick", mkdtemp(), settings=twin)[0].path)
    >>> session.readings("wrench").column("fz").shape == session.readings("wrench").time.shape
    True
    >>> {"contact", "force", "position", "slip"} <= {*session.labels.columns}
    True
    """

    @checked
    def __init__(self, path: Path) -> None:
        self.path = path
        self._view = chunks.mapped(path)
        self._names: dict[int, str] = {}
        self._parts: list[chunks.Record] = []
        self._holes, self._ended, ours, moved = 0, False, True, False
        self.malformed: dict[str, tuple[int, str]] = {}
        opening: dict[str, str] = {}
        self.ending: dict[str, str] = {}
        self.recovered = False
        for record in chunks.records(self._view):
            content = record.content
            if self._ended:  # the summary
                self._names |= chunks.named(content)
            elif isinstance(content, Metadata):
                opening = content.metadata if content.name == BEGIN else opening
                moved |= content.name == BEGIN and bool(self._parts)
                self.ending = content.metadata if content.name == END else self.ending
                self.recovered = self.recovered or content.name == RECOVERED
            elif record.opcode in (chunks.CHUNK, chunks.LOOSE):
                self._parts.append(record)
            elif record.opcode == chunks.HEADER:
                ours = not rewritten(bytes(record.body))
            self._holes += record.opcode == chunks.DAMAGED
            self._ended |= record.opcode == chunks.DATA_END
        refuse_later(path, opening)
        unpacked = sum(map(chunks.unpacked_size, self._parts))
        refuse_unpacking(f"session {path}", len(self._view), unpacked, "unpack it: mcap decompress")
        # Where another program wrote the file, its order says nothing.
        self._as_written = ours and not moved and bool(opening or self._holes)
        origin = opening.get("origin", "0.0")
        opening |= self._described_again(origin, self._parts[:1])
        if "description" not in opening:  # other programs leave metadata out, and sort by topic
            opening |= self._described_again(origin, self._parts)
        if "description" not in opening:
            remedy = "import audio and labels with: monochord sessions import"
            raise InputError(f"file {path} (MCAP, but not a session)", "a Monochord session", remedy)
        try:
            self.description = Description.load(opening["description"])
            self.clock = SessionClock.load(opening)
        except InputError as error:
            given = f"file {path} (its description is damaged: {error.given})"
            raise InputError(given, error.expected, "repair it: monochord sessions recover") from error
        # As every session of ours numbers them; where the chunk that says so is damaged, this does.
        self._names = (dict(enumerate(self.topics, 1)) if ours else {}) | self._names

    def _described_again(self, origin: str, parts: list[chunks.Record]) -> dict[str, str]:
        """Return the description and clock from the checksummed message; nothing where it is missing."""
        try:
            float(origin)
        except ValueError:
            origin = "0.0"  # no time that is read depends on it
        for _, _, _, topic, message in chunks.messages_of(parts, {}):
            if topic == "/description":
                try:
                    text = codec.decode(codec.TEXT, message.data).data
                except InputError:
                    return {}
                return {"description": text, "epoch_ns": str(message.log_time), "origin": origin}
        return {}

    @property
    def complete(self) -> bool:
        """Whether the session was closed, rather than cut off."""
        return bool(self.ending) or (self._ended and not self.recovered and not self._holes)

    @cached_property
    def damaged(self) -> int:
        """Number of damaged records or chunks; all reads leave their content out."""
        return self._holes + sum(not chunks.contents(each).sound for each in self._parts)

    @property
    def streams(self) -> tuple[str, ...]:
        """Names of the streams of readings, without the labels."""
        return tuple(feed.stream for feed in self.description.feeds if feed.stream != LABELS)

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of all topics, streams included."""
        return (*codec.TOPICS, *(codec.topic_of(stream) for stream in self.streams))

    @checked
    def messages(self, topic: str) -> Iterator[chunks.Message]:
        """Yield the messages of a topic in recording order; audio in order of frames.

        In a file written by another program, messages come in order of log time. Damaged chunks are left out.
        """
        rows = self._table.get(topic)
        if rows is None:
            return
        held, records = -1, memoryview(b"")
        for first in range(0, len(rows), PIECE):
            for _, part, start, stop in rows[first : first + PIECE].tolist():
                if part != held:
                    held, records = part, chunks.contents(self._parts[part]).records
                yield chunks.message(records[start:stop])

    @cached_property
    def _table(self) -> dict[str, NDArray[np.uint64]]:
        return chunks.message_table(self._parts, self._names, as_written=self._as_written)

    @property
    def channels(self) -> dict[int, str]:
        """Topic of each channel, by channel number."""
        _ = self._table
        return self._names

    @checked
    def decoded(self, topic: str) -> Iterator[tuple[chunks.Message, Any]]:
        """Yield the messages of a topic with their decoded content; malformed ones are counted instead."""
        count = 0
        for message in self.messages(topic):
            try:
                content = self._decode(topic, message)
            except InputError as error:
                count += 1
                first = self.malformed[topic][1] if count > 1 else error.given
                self.malformed[topic] = count, first
                continue
            yield message, content

    def _decode(self, topic: str, message: chunks.Message) -> Any:
        """Return a decoded message; raises `InputError` where it contradicts the description."""
        kind, width = codec.TOPICS.get(topic), 0
        if kind is None:
            feed = self.description.feed(topic.removeprefix("/"))
            kind, width = codec.type_of(feed), len(feed.columns)
        content = codec.decode(kind, message.data)
        if kind == codec.AUDIO:
            self._refuse_audio(content)
            self._refuse_stamps(np.array([message.log_time], np.uint64))
        elif kind == codec.POSES:
            self._refuse_stamps(np.array([message.log_time], np.uint64))
        elif kind in (codec.WRENCHES, codec.READINGS):
            self._refuse_stamps(content.arrival)
            if kind == codec.READINGS and len(content.columns) != width:
                raise InputError(f"readings of {len(content.columns)} columns", f"{width}, as described")
        elif kind == codec.LABELS:
            self._refuse_stamps(content.time)
        elif kind in (codec.EVENT, codec.CLOCKS):
            self._refuse_stamps(np.array([codec.nanoseconds(content.header.stamp)]))
        return content

    def _refuse_audio(self, content: Any) -> None:
        description = self.description
        if content.channels != description.channels:
            raise InputError(f"audio of {content.channels} channels", f"{description.channels}, as described")
        stop, limit = (
            content.start + len(content.samples) // content.channels,
            MAX_DURATION * description.sample_rate,
        )
        if stop > limit:
            raise InputError(f"audio up to frame {stop}", f"{limit:.0f} frames, or {MAX_DURATION:g} s")

    def _refuse_stamps(self, stamps: Any) -> None:
        """Refuse times further from the start than a session may last."""
        begin, reach = self.clock.epoch_ns, round(MAX_DURATION * NANO)
        low, high = (int(stamps.min()), int(stamps.max())) if len(stamps) else (begin, begin)
        if low < begin - reach or high > begin + reach:
            far = (low if low < begin - reach else high) - begin
            raise InputError(
                f"time {far / NANO:g} s from the start", f"at most {MAX_DURATION:g} s either way"
            )

    @cached_property
    def audio(self) -> AudioTrack:
        """The microphones' audio; raises `InputError` where it exceeds this machine's memory."""
        blocks = [(block, message) for message, block in self.decoded("/audio")]
        channels, rate = self.description.channels, self.description.sample_rate
        end = max((b.start + b.samples.size // channels for b, _ in blocks), default=0)
        what = f"session {self.path} with {end / rate:.0f} s of audio, its gaps counted in"
        remedy = "export it: an export reads piece by piece"
        refuse_beyond_memory(what, 4 * channels * end, remedy)
        try:
            samples = np.zeros((channels, end), dtype=np.float32)
        except MemoryError as error:
            given = f"{what} ({4e-9 * channels * end:.1f} GB)"
            raise InputError(given, "a session that fits into memory", remedy) from error
        gaps: list[tuple[int, int]] = []
        timed: list[tuple[int, float]] = []
        counted: list[int] = []
        reached = 0
        for block, message in blocks:
            part = block.samples.reshape(channels, -1)
            samples[:, block.start : block.start + part.shape[1]] = part
            if block.start > reached:
                gaps.append((reached, block.start))
            reached = max(reached, block.start + part.shape[1])
            if block.timed:
                timed.append((block.start, self.clock.seconds(message.log_time)))
                counted.append(block.frame_time)
        anchors = np.array(timed, dtype=np.float64).reshape(-1, 2)
        return AudioTrack(
            samples=samples,
            sample_rate=rate,
            gaps=tuple(gaps),
            anchor_frame=anchors[:, 0],
            anchor_time=anchors[:, 1],
            device_frame=np.array(counted, dtype=np.int64),
        )

    @checked
    def to_numpy(self, stream: str) -> NDArray[Any]:
        """Return a stream as a structured array (n,); see `monochord.sessions.reader.table`."""
        return table(self, stream)

    @checked
    def to_pandas(self, stream: str) -> "DataFrame":
        """Return a stream, ``audio`` or ``labels`` as a data frame, indexed by session time in s.

        Raises
        ------
        InputError
            If the stream does not exist, or pandas is not installed.
        """
        return frame(self, stream)

    def plot(self) -> "tuple[Axes, ...]":
        """Plot the session over time: the sound, the streams of readings, and the touch labels.

        Returns
        -------
        tuple of Axes
            One for each plot, in a new pyplot figure.

        Raises
        ------
        MissingLibraryError
            If matplotlib is not installed; the error says how to install it.
        """
        feeds = [self.description.feed(stream) for stream in self.streams]
        return tracks_plot(self.audio, [(feed, self.readings(feed.stream)) for feed in feeds], self.labels)

    def __repr__(self) -> str:
        return lines(*self._facts())

    def _repr_html_(self) -> str:
        return html_table(*self._facts())

    def _facts(self) -> tuple[str, list[tuple[str, str]]]:
        about = self.description
        channels = f"{about.channels} channel{'s' * (about.channels != 1)}"
        streams = [f"{feed.stream} ({', '.join(feed.columns)})" for feed in about.feeds]
        sensor = str(about.sensor.get("name", "")) or "not known"
        length = f"{self.length:.2f} s" + ("" if self.complete else ", cut off or damaged")
        return f"Session: {about.name}{', simulated' if about.simulated else ''}", [
            ("file", str(self.path)),
            ("length", length),
            ("sensor", sensor),
            ("touched by", about.material or about.object or "not known"),
            ("audio", f"{channels} at {about.sample_rate} Hz"),
            ("streams", ", ".join(streams) or "none beside the audio"),
        ]

    @cached_property
    def length(self) -> Seconds:
        """Length of the audio in s, gaps included, from its last block; the audio itself is not read."""
        rows = self._table.get("/audio")
        for row in [] if rows is None else rows[::-1]:
            _, part, start, stop = row.tolist()
            try:
                block = self._decode(
                    "/audio", chunks.message(chunks.contents(self._parts[part]).records[start:stop])
                )
            except InputError:
                continue
            return (block.start + len(block.samples) // block.channels) / self.description.sample_rate
        return 0.0

    @checked
    def readings(self, stream: str) -> ReadingTrack:
        """Return a stream of readings; raises `InputError` for an unknown name."""
        feed = self.description.feed(stream)
        messages = self.decoded(codec.topic_of(stream))
        if codec.type_of(feed) == codec.POSES:
            return self._poses(feed, messages)
        batches = [content for _, content in messages]
        width = len(feed.columns)
        if codec.type_of(feed) == codec.WRENCHES:
            values = [np.hstack([m.force.reshape(-1, 3), m.torque.reshape(-1, 3)]) for m in batches]
        else:
            values = [m.values.reshape(-1, width) for m in batches]
        return ReadingTrack(
            feed=feed,
            time=self.clock.seconds(_joined([m.arrival for m in batches], np.int64)),
            values=np.concatenate([np.zeros((0, width)), *values]),
            sequence=_joined([m.sequence for m in batches], np.int64),
            device_time=_joined([m.device_time for m in batches], np.int64),
            status=_joined([m.status for m in batches], np.uint32),
        )

    @cached_property
    def labels(self) -> LabelTrack:
        """The labels; no columns where the session has none."""
        batches = [content for _, content in self.decoded("/labels")]
        names = self._names_of("label columns", (m.columns for m in batches))
        columns: dict[str, list[Any]] = {name: [] for name in names}
        for m in batches:
            values = m.values.reshape(len(m.time), -1)
            for name, parts in columns.items():
                given = name in m.columns
                unknown = np.full(len(m.time), np.nan)
                parts.append(values[:, m.columns.index(name)] if given else unknown)
        return LabelTrack(
            time=self.clock.seconds(_joined([m.time for m in batches], np.int64)),
            columns={name: _joined(parts, np.float64) for name, parts in columns.items()},
        )

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """Events in order of time."""
        messages = [content for _, content in self.decoded("/events")]
        events = [
            Event(
                time=float(self.clock.seconds(codec.nanoseconds(m.header.stamp))),
                kind=m.kind,
                text=m.text,
                data=json_object(m.data or "{}"),
            )
            for m in messages
        ]
        return tuple(sorted(events, key=lambda event: event.time))

    @cached_property
    def clocks(self) -> ClockTrack:
        """Offsets of this machine's clocks from the monotonic clock."""
        messages = [content for _, content in self.decoded("/clocks")]
        names = sorted(self._names_of("clocks", (m.names for m in messages)))
        rows = [dict(zip(m.names, m.offsets.tolist(), strict=True)) for m in messages]
        return ClockTrack(
            time=self.clock.seconds(
                np.array([codec.nanoseconds(m.header.stamp) for m in messages], np.int64)
            ),
            offsets={name: np.array([row.get(name, np.nan) for row in rows]) for name in names},
        )

    def _names_of(self, what: str, each: Iterable[list[str]]) -> list[str]:
        """Return all names in order; raises `InputError` where a table would have too many columns."""
        names = dict.fromkeys(name for part in each for name in part)
        if len(names) > MAX_COLUMNS:
            raise InputError(f"session {self.path} with {len(names)} {what}", f"{MAX_COLUMNS} at most")
        return list(names)

    def _poses(self, feed: Feed, messages: Iterator[tuple[chunks.Message, Any]]) -> ReadingTrack:
        arrivals: list[int] = []
        sequence: list[int] = []
        sent: list[int] = []
        values: list[tuple[float, ...]] = []
        for message, content in messages:
            stamp, pose = codec.pose_of(content)
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
"""Marks a missing sequence number in a message's 32 bits."""


PIECE = 4096
"""Number of message positions looked up at a time."""


def _joined(parts: list[Any], kind: Any) -> Any:
    return np.concatenate([np.zeros(0, kind), *parts]).astype(kind, copy=False)


def table(session: SessionReader, stream: str) -> NDArray[Any]:
    """Return a stream as a structured array (n,) whose first field is ``time``, in session seconds.

    ``audio`` has one field per microphone (``mic_1``, ``mic_2``) in full scale, ``labels`` one per label, and
    a stream of readings one per column plus ``sequence`` and ``status``. An unknown one raises `InputError`.
    """
    if stream == AUDIO:
        audio = session.audio
        columns = {f"mic_{number}": row for number, row in enumerate(audio.samples, start=1)}
        return _structured(audio.time(np.arange(audio.samples.shape[1])), columns)
    if stream == LABELS:
        return _structured(session.labels.time, session.labels.columns)
    if stream not in session.streams:
        names = (AUDIO, LABELS, *session.streams)
        raise InputError(f"stream '{stream}'", ", ".join(names), did_you_mean(stream, names))
    track = session.readings(stream)
    columns = {name: track.column(name) for name in track.feed.columns}
    return _structured(track.time, {**columns, "sequence": track.sequence, "status": track.status})


def frame(session: SessionReader, stream: str) -> "DataFrame":
    """Return a stream as a data frame indexed by time; raises `InputError` where pandas is not installed."""
    with required("A data frame", "pandas >= 2.2", "pandas"):
        from pandas import DataFrame  # noqa: PLC0415
    rows = table(session, stream)
    names = rows.dtype.names or ()
    return DataFrame({name: rows[name] for name in names}).set_index("time")


def _structured(time: Floats, columns: dict[str, Any]) -> NDArray[Any]:
    kinds = [("time", np.float64), *((name, values.dtype) for name, values in columns.items())]
    rows = np.empty(len(time), kinds)
    rows["time"] = time
    for name, values in columns.items():
        rows[name] = values
    return rows
