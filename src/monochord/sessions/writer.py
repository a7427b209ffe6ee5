"""Writes a session during recording: one MCAP file, valid after every flush."""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from monochord.core.closing import Closing
from monochord.core.errors import InputError
from monochord.core.ranges import Finite, checked
from monochord.core.types import Block, Floats, Readings
from monochord.core.units import Samples, Seconds
from monochord.sessions import codec
from monochord.sessions._digest import Digest
from monochord.sessions._layout import END, TOTALS, begin, guarded
from monochord.sessions.bounds import MAX_COLUMNS, json_object
from monochord.sessions.chunks import ChunkList
from monochord.sessions.description import LATEST_STAMP, Description, SessionClock
from monochord.sessions.file import SessionFile
from monochord.sessions.repair import recover
from monochord.sessions.tracks import LABELS

AUDIO_MESSAGE: Seconds = 0.1
"""Largest audio in a message."""
MAX_READINGS = 256
"""Largest number of readings in a message."""
MAX_UNFLUSHED = 1 << 20
"""Largest number of bytes that wait for a flush."""
OF_SUMMARY, OF_CHUNK, OF_TOPIC = 1 << 16, 96, 10
"""Largest size of the ending in bytes: in total, per chunk, per topic in a chunk."""
CHUNKS = "_Writer__chunk_indices"
"""Attributes in which mcap's writer remembers what it wrote."""


class SessionWriter(Closing):
    """An open session. All times are seconds of the monotonic clock, as in `Block` and `Readings`.

    Everything passed in before a `flush` is in the file, complete and readable, even if the program crashes.
    Where the disk is full, the file is closed with its current content, and the call raises `OSError`.

    Parameters
    ----------
    path
        A new file, ``NAME.mcap``.
    description
        The session's description; `readings` accepts the streams of its feeds. It is read back, as from the
        file, before the file is made.
    clock
        The session's clock; by default, one that starts now.

    Raises
    ------
    InputError
        If the file exists or cannot be created, or if no reader could read the description.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> twin = mc.VirtualSensor("prototype", seed=1)
    >>> about = mc.Description(name="take", sample_rate=twin.sample_rate, string=twin.sensor.string)
    >>> with mc.SessionWriter(Path(mkdtemp()) / "take.mcap", about) as writer:
    ...     sound, _ = twin.advance(0.5)
    ...     writer.audio(mc.Block(samples=sound, start=0, adc_time=writer.clock.origin))
    >>> mc.read_session(writer.path).length
    0.5
    """

    @checked
    def __init__(self, path: str | Path, description: Description, clock: SessionClock | None = None) -> None:
        self.path, self.description = Path(path), Description.load(description.dump())
        self.clock = SessionClock.now() if clock is None else SessionClock.load(clock.dump())
        self._file = SessionFile(self.path)
        self._closed = False
        self._pending: list[Block] = []
        self._end: Samples = 0
        self._counts = {"frames": 0, "dropped": 0, "gaps": 0, "end": 0}
        self._digests: dict[int, Digest] = {}
        self._unflushed = self._chunks = 0
        try:
            text = self.description.dump()
            self._writer, self._channels = begin(self._file, self.description, text, self.clock)
            # The library has no other way to keep its memory from growing with the file.
            library = vars(self._writer)
            assert CHUNKS in library, "mcap keeps its chunks elsewhere"
            library[CHUNKS] = ChunkList(self._file)
            for number in self._channels.values():
                self._digests[number] = Digest()
            self._put("/description", self.clock.epoch_ns, codec.encode(codec.TEXT, data=text))
            self.flush()
        except BaseException:
            self._file.close()
            self.path.unlink(missing_ok=True)
            raise

    @property
    def size(self) -> int:
        """Size of the file so far, in bytes."""
        return self._file.tell()

    @checked
    def audio(self, block: Block) -> None:
        """Add the next block, whose array is copied; consecutive blocks are joined into one message.

        Raises `InputError` for a block of other channels, or one that begins before the last one's end.
        """
        self._refuse_closed()
        if block.samples.shape[0] != self.description.channels:
            given = f"block of {block.samples.shape[0]} channels"
            raise InputError(given, f"{self.description.channels}, as described")
        if block.start < self._end:
            given = f"a block from frame {block.start}"
            raise InputError(given, f"{self._end} or later, where the last one ended")
        if self._pending and (block.dropped or block.start != self._end):
            self._write_audio()
        self._pending.append(replace(block, samples=block.samples.copy()))
        self._end = block.start + block.samples.shape[1]
        if (
            sum(each.samples.shape[1] for each in self._pending)
            >= AUDIO_MESSAGE * self.description.sample_rate
        ):
            self._write_audio()
        self._flush_if_due()

    @checked
    def readings(self, readings: Readings) -> None:
        """Add readings of a stream in the description's feeds; those of ``labels`` are labels."""
        self._refuse_closed()
        feed = self.description.feed(readings.stream)
        if readings.values.shape != (len(readings.time), len(feed.columns)):
            given = f"readings of shape {readings.values.shape} for stream '{feed.stream}'"
            raise InputError(given, f"({len(readings.time)}, {len(feed.columns)})")
        if feed.stream == LABELS:
            self.labels(readings.time, dict(zip(feed.columns, readings.values.T, strict=True)))
            return
        stamps, topic = self.clock.stamps(readings.time), codec.topic_of(feed.stream)
        if codec.type_of(feed) == codec.POSES:
            for stamp, sent, count, values in zip(
                stamps.tolist(),
                readings.device_time.tolist(),
                readings.sequence.tolist(),
                readings.values,
                strict=True,
            ):
                sent_at = sent if 0 < sent < LATEST_STAMP else 0
                self._put(topic, stamp, codec.encode_pose(sent_at, values), sent_at or stamp, count)
            self._flush_if_due()
            return
        for first in range(0, len(stamps), MAX_READINGS):
            part = slice(first, first + MAX_READINGS)
            shared = {
                "header": codec.header(int(stamps[first]), feed.stream),
                "arrival": stamps[part],
                "sequence": readings.sequence[part],
                "device_time": readings.device_time[part],
                "status": readings.status[part],
            }
            values = np.ascontiguousarray(readings.values[part], dtype=np.float64)
            if codec.type_of(feed) == codec.WRENCHES:
                split = {"force": values[:, :3].ravel(), "torque": values[:, 3:].ravel()}
                data = codec.encode(codec.WRENCHES, **shared, **split)
            else:
                columns = list(feed.columns)
                data = codec.encode(codec.READINGS, **shared, columns=columns, values=values.ravel())
            self._put(topic, int(stamps[first]), data)
        self._flush_if_due()

    @checked
    def labels(self, time: Floats, columns: Mapping[str, Floats]) -> None:
        """Add labels at times (n,): columns (n,) by name, NaN where unknown."""
        self._refuse_closed()
        _refuse_too_many("labels of", len(columns))
        if not columns or time.ndim != 1 or any(each.shape != time.shape for each in columns.values()):
            shapes = ", ".join(
                f"{name} of shape {each.shape}" for name, each in {"time": time, **columns}.items()
            )
            raise InputError(f"labels with {shapes}", "time (n,), and one column or more (n,)")
        stamps = self.clock.stamps(time)
        values = np.stack([np.asarray(columns[name], np.float64) for name in columns], axis=1)
        for first in range(0, len(stamps), MAX_READINGS):
            part = slice(first, first + MAX_READINGS)
            data = codec.encode(
                codec.LABELS,
                header=codec.header(int(stamps[first])),
                columns=list(columns),
                time=stamps[part],
                values=values[part].ravel(),
            )
            self._put("/labels", int(stamps[first]), data)
        self._flush_if_due()

    @checked
    def event(self, time: Finite[Seconds], kind: str, text: str = "", /, **data: str | float | bool) -> None:
        """Write an event."""
        self._refuse_closed()
        stamp, more = self.clock.stamp(time), json.dumps(data, sort_keys=True)
        json_object(more)  # as every reader reads it
        fields = {"header": codec.header(stamp), "kind": kind, "text": text, "data": more}
        self._put("/events", stamp, codec.encode(codec.EVENT, **fields))

    @checked
    def clocks(self, time: Finite[Seconds], offsets: Mapping[str, Finite[Seconds]]) -> None:
        """Record this machine's clock offsets from the monotonic clock at a time."""
        self._refuse_closed()
        _refuse_too_many("offsets of", len(offsets))
        stamp, names = self.clock.stamp(time), sorted(offsets)
        values = np.array([offsets[name] for name in names], np.float64)
        data = codec.encode(codec.CLOCKS, header=codec.header(stamp), names=names, offsets=values)
        self._put("/clocks", stamp, data)

    @checked
    def flush(self, *, sync: bool = False) -> None:
        """Write everything added so far to the file; with `sync`, wait until it is on the disk.

        Raises
        ------
        OSError
            If the disk is full (ENOSPC) or the file has reached its size limit (EFBIG). The file has then
            been closed and is valid.
        """
        self._refuse_closed()
        try:
            self._write_audio()
            self._writer.flush()
            self._chunks += self._unflushed > 0
            self._unflushed = 0
            self._file.reserve(OF_SUMMARY + self._chunks * (OF_CHUNK + OF_TOPIC * len(self._channels)))
        except OSError:
            self._finish_file()
            raise
        if self._file.full:
            self.close()
            raise OSError(self._file.full, os.strerror(self._file.full), str(self.path))
        if sync:
            self._file.sync()

    def sync(self) -> None:
        """Wait until the flushed data are on the disk; may be called from another thread."""
        if not self._closed:
            self._file.sync()

    def close(self) -> None:
        """Write the rest, the checksums and the summary. A second call does nothing."""
        if self._closed:
            return
        try:
            self._write_audio()
            self._closed = True
            self._writer.flush()
            self._writer.add_metadata(END, guarded(self._closing_values()))
            self._writer.finish()
            self._file.sync()
            self._file.close()
        except OSError:
            self._finish_file()
            raise

    def _closing_values(self) -> dict[str, str]:
        """Return the closing values: messages and SHA-256 of each topic, counts, the clock."""
        digests = {topic: self._digests[number] for topic, number in self._channels.items()}
        ordered = json.dumps({topic: each.ordered for topic, each in digests.items()}, sort_keys=True)
        return {
            "checksum": hashlib.sha256(ordered.encode()).hexdigest(),
            "sha256": ordered,
            TOTALS: json.dumps({topic: each.total for topic, each in digests.items()}, sort_keys=True),
            "messages": json.dumps({topic: each.count for topic, each in digests.items()}, sort_keys=True),
            **{name: str(count) for name, count in self._counts.items()},
            **self.clock.dump(),
        }

    def _finish_file(self) -> None:
        """Close the file with its complete content."""
        self._closed = True
        try:
            self._file.close()
        finally:
            recover(self.path)

    def _write_audio(self) -> None:
        if not self._pending:
            return
        blocks, self._pending = self._pending, []
        first, rate = blocks[0], self.description.sample_rate
        timed = first.adc_time is not None
        samples = np.concatenate([block.samples for block in blocks], axis=1).astype(np.float32, copy=False)
        frames: Samples = samples.shape[1]
        estimate = self.clock.origin + first.start / rate
        stamp = self.clock.stamp(estimate if first.adc_time is None else first.adc_time)
        data = codec.encode(
            codec.AUDIO,
            header=codec.header(stamp, "pickups"),
            start=first.start,
            dropped=first.dropped,
            timed=timed,
            frame_time=-1 if first.frame_time is None else first.frame_time,
            sample_rate=rate,
            channels=samples.shape[0],
            samples=np.ascontiguousarray(samples).ravel(),
        )
        self._put("/audio", stamp, data)
        counts = self._counts
        counts["frames"] += frames
        counts["dropped"] += first.dropped
        counts["gaps"] += first.dropped > 0
        counts["end"] = first.start + frames

    def _flush_if_due(self) -> None:
        if self._unflushed > MAX_UNFLUSHED:
            self.flush()

    def _put(self, topic: str, stamp: int, data: bytes, sent: int | None = None, sequence: int = 0) -> None:
        number = self._channels[topic]
        published, count = stamp if sent is None else sent, sequence % (1 << 32)
        self._digests[number].add(stamp, published, count, data)
        self._unflushed += len(data)
        self._writer.add_message(number, log_time=stamp, data=data, publish_time=published, sequence=count)

    def _refuse_closed(self) -> None:
        if self._closed:
            raise InputError(f"session {self.path} (closed)", "an open session", "open a new one")


def _refuse_too_many(what: str, count: int) -> None:
    if count > MAX_COLUMNS:
        raise InputError(f"{what} {count} names", f"{MAX_COLUMNS} at most")
