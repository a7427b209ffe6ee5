"""A session as plain columns, and back: shared by the lossless formats."""

import json
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from monochord.core.config import Tree
from monochord.core.errors import InputError
from monochord.core.files import refuse_endless, written
from monochord.core.types import Audio, Block, Feed, Readings
from monochord.core.units import Samples, Seconds
from monochord.sessions import Description, SessionClock, SessionReader, SessionWriter
from monochord.sessions.bounds import MAX_COLUMNS, MAX_DURATION, MAX_TEXT, json_object

ABOUT = "session.json"
"""The file that describes the other files."""
COMMON_TABLES = ("labels", "events", "clocks")
"""Tables of every session; each stream of readings adds a table of its name."""
Columns: TypeAlias = dict[str, np.ndarray[Any, np.dtype[Any]]]
"""Columns (n,) by name; text has type object. The first is ``time`` in s since the session's beginning."""
READING_COLUMNS = {"sequence": np.int64, "device_time": np.int64, "status": np.uint32}
"""Columns of a reading beside time and values, with their types in a session."""
MAX_STRETCH = 1 << 25
"""Largest number of frames in a stretch, which is read and written at once: some 10 minutes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """Consecutive frames as the session holds them: samples (channels, n).

    `time` is that of the first frame. Where `timed` is false, the device gave no time, and `time` follows
    from `start`. `device_frame` is the device's frame count, -1 where it has none.
    """

    start: Samples
    dropped: Samples
    time: Seconds
    timed: bool
    device_frame: Samples
    samples: Audio


def stretches(session: SessionReader) -> Iterator[Stretch]:
    """Yield a session's audio in file order."""
    for message, block in session.decoded("/audio"):
        yield Stretch(
            start=int(block.start),
            dropped=int(block.dropped),
            time=float(session.clock.seconds(message.log_time)),
            timed=bool(block.timed),
            device_frame=int(block.frame_time),
            samples=block.samples.reshape(session.description.channels, -1),
        )


def tables(session: SessionReader) -> dict[str, Columns]:
    """Return everything else in a session, by table name."""
    by_name: dict[str, Columns] = {}
    for stream in session.streams:
        track = session.readings(stream)
        beside = {name: getattr(track, name) for name in READING_COLUMNS}
        values = {name: track.values[:, number] for number, name in enumerate(_columns(track.feed))}
        by_name[stream] = {"time": track.time, **beside, **values}
    labels, events, clocks = session.labels, session.events, session.clocks
    if "time" in labels.columns or "time" in clocks.offsets:
        given = f"session {session.path} with a label or a clock called 'time'"
        raise InputError(given, "names other than 'time'")
    by_name["labels"] = {"time": labels.time, **labels.columns}
    by_name["events"] = {
        "time": np.array([event.time for event in events], dtype=np.float64),
        "kind": np.array([event.kind for event in events], dtype=object),
        "text": np.array([event.text for event in events], dtype=object),
        "data": np.array([json.dumps(event.data, sort_keys=True) for event in events], dtype=object),
    }
    by_name["clocks"] = {"time": clocks.time, **clocks.offsets}
    return by_name


def about(session: SessionReader, form: str) -> Tree:
    """Return the content of `ABOUT`, which identifies the session to a reader of this format."""
    return {
        "form": form,
        "clock": session.clock.dump(),
        "complete": session.complete,
        "description": json.loads(session.description.dump()),
    }


def write_about(session: SessionReader, form: str, folder: Path) -> Path:
    """Write the description and clock of a session into its exported folder; return the file."""
    text = json.dumps(about(session, form), indent=1, sort_keys=True, ensure_ascii=False)
    with written(folder / ABOUT):
        (folder / ABOUT).write_text(text + "\n", encoding="utf-8")
    return folder / ABOUT


def form_of(folder: Path) -> str:
    """Return the format a folder was exported in; raises `InputError` for any other folder."""
    return str(_read_json(folder, "a folder that a session was exported to")["form"])


def read_about(folder: Path, form: str) -> tuple[Description, SessionClock]:
    """Read the `about` content of an exported folder; raises `InputError` where it is invalid."""
    allowed = f"a folder that was exported as {form}"
    content = _read_json(folder, allowed)
    if content["form"] != form:
        raise InputError(f"folder {folder} ({content['form']})", allowed)
    parts = {name: content.get(name) for name in ("description", "clock")}
    for name, part in parts.items():
        if not isinstance(part, dict):
            raise InputError(f"file {folder / ABOUT} (changed since the export: no table '{name}')", allowed)
    try:
        return Description.load(json.dumps(parts["description"])), SessionClock.load(content["clock"])
    except InputError as error:
        given = f"file {folder / ABOUT} (changed since the export: {error.given})"
        raise InputError(given, error.expected, error.remedy) from error


def _read_json(folder: Path, allowed: str) -> Tree:
    path = folder / ABOUT
    refuse_endless(path)
    try:
        with path.open("rb") as file:
            raw = file.read(4 * MAX_TEXT + 1)  # of one character, UTF-8 makes 4 bytes at most
        content = json_object(raw.decode())
    except OSError as error:
        raise InputError(f"folder {folder} (no {ABOUT}: {error.strerror})", allowed) from error
    except UnicodeDecodeError as error:
        raise InputError(f"file {path} (changed since the export: {error})", "JSON in UTF-8") from error
    except InputError as error:
        raise InputError(f"file {path} (changed since the export: {error.given})", error.expected) from error
    if not isinstance(content.get("form"), str):
        raise InputError(f"file {path} (changed since the export: it names no form)", allowed)
    return content


def checked(path: Path, name: str, columns: Columns, description: Description) -> Columns:
    """Return a table read from the file `path`, with a session's column types.

    Raises `InputError` where a column is missing, of the wrong type or out of range, a time is outside a
    session's limits, or an event's data is not a JSON object.
    """
    needed = columns_of(name, description)
    if missing := sorted(set(needed) - set(columns)):
        raise InputError(f"file {path} without {', '.join(missing)}", ", ".join(needed))
    extra = [key for key in columns if key not in needed] if name in ("labels", "clocks") else []
    if len(extra) > MAX_COLUMNS:
        raise InputError(f"file {path} with {len(extra)} columns", f"{MAX_COLUMNS} at most")
    table = {key: _cells(f"file {path}, column {key}", name, key, columns[key]) for key in (*needed, *extra)}
    wrong = np.flatnonzero(~(np.abs(table["time"]) <= MAX_DURATION))
    if len(wrong):
        given = f"file {path}, {wrong[0] + 1}. time {table['time'][wrong[0]]:g}"
        raise InputError(given, f"seconds since the session's beginning, at most {MAX_DURATION:g} either way")
    for number, data in enumerate(table["data"] if name == "events" else (), start=1):
        try:
            json_object(data)
        except InputError as error:
            raise InputError(f"file {path}, {number}. data ({error.given})", error.expected) from error
    return table


def _cells(
    what: str, name: str, key: str, column: np.ndarray[Any, np.dtype[Any]]
) -> np.ndarray[Any, np.dtype[Any]]:
    """Return a column with its type in a session."""
    if name == "events" and key != "time":
        if not all(isinstance(cell, str) for cell in column):
            raise InputError(f"{what} with cells that are not text", "text")
        return column
    if column.dtype.kind not in "fiub":
        raise InputError(f"{what} of {column.dtype}", "numbers")
    if name not in COMMON_TABLES and key in READING_COLUMNS:
        return _whole(what, column, READING_COLUMNS[key])
    return column.astype(np.float64)


def _whole(what: str, column: np.ndarray[Any, np.dtype[Any]], kind: type) -> np.ndarray[Any, np.dtype[Any]]:
    """Return whole numbers as the integer type `kind`; raises `InputError` where they do not fit."""
    bounds = np.iinfo(kind)
    if column.dtype.kind not in "iu":
        raise InputError(f"{what} of {column.dtype}", "whole numbers")
    if len(column) and not (bounds.min <= int(column.min()) and int(column.max()) <= bounds.max):
        given = f"{what} from {column.min()} to {column.max()}"
        raise InputError(given, f"{bounds.min} to {bounds.max}")
    return column.astype(kind)


def write_back(
    path: Path,
    description: Description,
    clock: SessionClock,
    audio: Iterable[Stretch],
    tables: Mapping[str, Columns],
) -> None:
    """Write a session from exported columns, everything in order of time.

    A session that was cut off comes back as a closed one. Tables are as `checked` returns them. `InputError`
    refuses a stretch that exceeds a session's limits.
    """
    with _whole_or_not_at_all(SessionWriter(path, description, clock)) as writer:
        rest = {name: _PendingRows(writer, name, columns) for name, columns in tables.items()}
        for stretch in audio:
            _refuse_stretch(stretch, description)
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
            writer.flush()  # it is not joined to the next one, and a file that is cut keeps it
        for each in rest.values():
            each.write(np.inf)


def _refuse_stretch(stretch: Stretch, description: Description) -> None:
    stop, limit = stretch.start + stretch.samples.shape[1], round(MAX_DURATION * description.sample_rate)
    if not (stretch.start >= 0 and stop <= limit and 0 <= stretch.dropped <= limit):
        given = f"audio from frame {stretch.start} to {stop}, {stretch.dropped} lost before"
        raise InputError(given, f"0 to {limit} frames, or {MAX_DURATION:g} s")
    if not abs(stretch.time) <= MAX_DURATION:
        given = f"audio at {stretch.time:g} s"
        raise InputError(given, f"seconds since the session's beginning, at most {MAX_DURATION:g} either way")
    if not -1 <= stretch.device_frame < 2**63:
        raise InputError(f"device frame {stretch.device_frame}", f"-1, or 0 to {2**63 - 1}")


@contextmanager
def _whole_or_not_at_all(writer: SessionWriter) -> Generator[SessionWriter]:
    try:
        with writer:
            yield writer
    except BaseException:
        writer.path.unlink(missing_ok=True)
        raise


class _PendingRows:
    """Rows of a table that wait to be written."""

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
                self._writer.event(float(at), kind, text, **json_object(data))
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
    """Return names for a feed's columns that differ from the table's other columns."""
    taken = {"time", *READING_COLUMNS}
    return tuple(f"value_{name}" if name in taken else name for name in feed.columns)


def columns_of(name: str, description: Description) -> tuple[str, ...]:
    """Return the columns that a table must have."""
    if name in COMMON_TABLES:
        return ("time", "kind", "text", "data") if name == "events" else ("time",)
    return "time", *READING_COLUMNS, *_columns(description.feed(name))


def table_names(description: Description) -> tuple[str, ...]:
    """Return the names of all tables of a session with this description."""
    streams = (feed.stream for feed in description.feeds if feed.stream not in COMMON_TABLES)
    return *streams, *COMMON_TABLES
