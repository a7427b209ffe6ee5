"""What a session holds as plain columns, and back: what every form that loses nothing has in common."""

import json
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from monochord.config import Tree
from monochord.errors import InputError
from monochord.sessions import Description, Session, SessionClock, SessionWriter, codec
from monochord.sessions.writer import MESSAGE
from monochord.types import Audio, Block, Feed, Readings
from monochord.units import Samples, Seconds

ABOUT = "session.json"
"""The file that says what the others are."""
OF_ALL = ("labels", "events", "clocks")
"""Tables that every session has; each stream of readings has one of its own name beside them."""
Columns: TypeAlias = dict[str, np.ndarray[Any, np.dtype[Any]]]
"""Columns (n,) by name; text is of type object. The first is ``time`` in s since the session's begin."""
KEPT_BESIDE = {"sequence": np.int64, "device_time": np.int64, "status": np.uint32}
"""What is kept of a reading beside its time and its values, under the types it has in a session."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """Consecutive frames as the session holds them: samples (channels, n); `time` is of the first.

    Where not `timed`, the device did not say when, and `time` follows from `start`. `device_frame` is the
    device's own count, -1 where it has none.
    """

    start: Samples
    dropped: Samples
    time: Seconds
    timed: bool
    device_frame: Samples
    samples: Audio


def stretches(session: Session) -> Iterator[Stretch]:
    """Yield a session's audio as it lies in the file."""
    for message in session.messages("/audio"):
        block = codec.decode(codec.AUDIO, message.data)
        yield Stretch(
            start=int(block.start),
            dropped=int(block.dropped),
            time=float(session.clock.seconds(message.log_time)),
            timed=bool(block.timed),
            device_frame=int(block.frame_time),
            samples=block.samples.reshape(session.description.channels, -1),
        )


def tables(session: Session) -> dict[str, Columns]:
    """Return everything else that a session holds, by the name that its file has."""
    found: dict[str, Columns] = {}
    for stream in session.streams:
        track = session.readings(stream)
        beside = {name: getattr(track, name) for name in KEPT_BESIDE}
        values = {name: track.values[:, number] for number, name in enumerate(_columns(track.feed))}
        found[stream] = {"time": track.time, **beside, **values}
    labels, events, clocks = session.labels, session.events, session.clocks
    if "time" in labels.columns or "time" in clocks.offsets:
        given = f"session {session.path} with a label or a clock called 'time'"
        raise InputError(given, "other names beside the times of a table")
    found["labels"] = {"time": labels.time, **labels.columns}
    found["events"] = {
        "time": np.array([event.time for event in events], dtype=np.float64),
        "kind": np.array([event.kind for event in events], dtype=object),
        "text": np.array([event.text for event in events], dtype=object),
        "data": np.array([json.dumps(event.data, sort_keys=True) for event in events], dtype=object),
    }
    found["clocks"] = {"time": clocks.time, **clocks.offsets}
    return found


def about(session: Session, form: str) -> Tree:
    """Return what tells a reader of the form which session this is."""
    return {
        "form": form,
        "clock": session.clock.dump(),
        "complete": session.complete,
        "description": json.loads(session.description.dump()),
    }


def form_of(folder: Path) -> str:
    """Return which form a folder was exported as; raises `InputError` where it is no session's."""
    return str(_told(folder, "a folder that a session was exported to")["form"])


def read_about(folder: Path, form: str) -> tuple[Description, SessionClock]:
    """Read what `about` told, from a folder that a form wrote; raises `InputError` where it is none."""
    allowed = f"a folder that was exported as {form}"
    told = _told(folder, allowed)
    if told["form"] != form:
        raise InputError(f"folder {folder} ({told['form']})", allowed)
    try:
        return Description.load(json.dumps(told["description"])), SessionClock.load(told["clock"])
    except InputError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"file {folder / ABOUT} (not as it was written)", allowed) from error


def _told(folder: Path, allowed: str) -> Tree:
    try:
        told = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"folder {folder} (no {ABOUT}: {error.strerror})", allowed) from error
    except ValueError as error:
        raise InputError(f"file {folder / ABOUT} (not as it was written)", allowed) from error
    if not isinstance(told, dict) or "form" not in told:
        raise InputError(f"file {folder / ABOUT} (not as it was written)", allowed)
    return told


def write_back(
    path: Path,
    description: Description,
    clock: SessionClock,
    audio: Iterable[Stretch],
    held: Mapping[str, Columns],
) -> None:
    """Write a session of what the others gave, everything in the order of its time.

    A session that was cut off comes back as one that was closed.
    """
    with _whole_or_not_at_all(SessionWriter(path, description, clock)) as writer:
        rest = {name: _Rest(writer, name, columns) for name, columns in held.items()}
        for stretch in audio:
            for each in rest.values():
                each.write(stretch.time)
            writer.audio(
                Block(
                    samples=stretch.samples,
                    start=stretch.start,
                    dropped=stretch.dropped,
                    adc_time=clock.origin + stretch.time if stretch.timed else None,
                    frame_time=None if stretch.device_frame < 0 else stretch.device_frame,
                )
            )
            if stretch.samples.shape[1] < MESSAGE * description.sample_rate:
                writer.flush()  # or it would be joined to the next one
        for each in rest.values():
            each.write(np.inf)


@contextmanager
def _whole_or_not_at_all(writer: SessionWriter) -> Generator[SessionWriter]:
    try:
        with writer:
            yield writer
    except BaseException:
        writer.path.unlink(missing_ok=True)
        raise


class _Rest:
    """What of a table is not yet written."""

    def __init__(self, writer: SessionWriter, name: str, columns: Columns) -> None:
        self._writer, self._name, self._columns = writer, name, columns
        # A time may step back; what came after it is still written after it.
        self._due = np.maximum.accumulate(columns["time"]) if len(columns["time"]) else columns["time"]
        self._next = 0

    def write(self, until: Seconds) -> None:
        stop = int(np.searchsorted(self._due, until))
        if stop <= self._next:
            return
        part = {name: column[self._next : stop] for name, column in self._columns.items()}
        self._next = stop
        time = self._writer.clock.origin + part.pop("time")
        if self._name == "labels":
            self._writer.labels(time, part)
        elif self._name == "clocks":
            for row, at in enumerate(time):
                self._writer.clocks(float(at), {name: float(column[row]) for name, column in part.items()})
        elif self._name == "events":
            for at, kind, text, data in zip(time, part["kind"], part["text"], part["data"], strict=True):
                self._writer.event(float(at), kind, text, **json.loads(data))
        else:
            self._readings(self._name, time, part)

    def _readings(self, stream: str, time: Any, part: Columns) -> None:
        names = _columns(self._writer.description.feed(stream))
        self._writer.readings(
            Readings(
                stream=stream,
                time=time,
                values=np.stack([part[name] for name in names], axis=1),
                sequence=part["sequence"],
                device_time=part["device_time"],
                status=part["status"],
            )
        )


def _columns(feed: Feed) -> tuple[str, ...]:
    """Return names for a feed's columns that no other column of its table has."""
    taken = {"time", *KEPT_BESIDE}
    return tuple(f"value_{name}" if name in taken else name for name in feed.columns)


def columns_of(name: str, description: Description) -> tuple[str, ...]:
    """Return the columns that a table must have."""
    if name in OF_ALL:
        return ("time", "kind", "text", "data") if name == "events" else ("time",)
    return "time", *KEPT_BESIDE, *_columns(description.feed(name))


def table_names(description: Description) -> tuple[str, ...]:
    """Return the names of all tables that a session of this description is written as."""
    streams = (feed.stream for feed in description.feeds if feed.stream not in OF_ALL)
    return *streams, *OF_ALL
