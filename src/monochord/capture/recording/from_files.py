"""Creates a session from audio and labels that were recorded elsewhere."""

import csv
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Stream
from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.files import refuse_endless, similar_name, without_index
from monochord.core.types import Floats, StringParams
from monochord.core.units import Seconds
from monochord.physics.known_touches import why_impossible
from monochord.sessions import ESTIMATES, Description, SessionClock, SessionWriter, read_session

AUDIO_FILES, SESSIONS = "wav", "session"  # the sources that read them
SESSION_SUFFIX = ".mcap"
POSES = "pose"
BLOCK: Seconds = 0.1
LABEL_RANGES: dict[str, tuple[float, float, str]] = {
    "contact": (0.0, 1.0, "0 or 1"),
    "slip": (0.0, 1.0, "0 or 1"),
}
"""Allowed values of a column."""
MAX_OVERHANG: Seconds = 1.0
"""Longest time by which labels may exceed the audio."""
TOUCH = ("begin", "end")
"""Columns of a table with one row per touch, in place of `time`."""
TOUCH_STEP: Seconds = 0.01
"""Time between the labels that such a row becomes, in s."""


def from_files(
    audio: Path,
    labels: Path | None,
    out: Path,
    *,
    described: Mapping[str, Any] | None = None,
    allow_truncated: bool = False,
) -> None:
    r"""Write a session from an audio file and a table of labels.

    The audio is WAV or FLAC, 1 or 2 channels at 16 to 192 kHz. Samples of up to 24 bits, and 32-bit floats,
    are stored exactly; wider ones are rounded to 32-bit floats. The session begins at the file's date minus
    its duration; without device times, frame n is at n / rate. In place of the file, a session recorded with
    microphones alone is accepted: its sensor, string and gaps are kept, and estimates that a live run
    recorded in it are left out, and so are poses: `monochord.live.touches` reads them for the table.

    Parameters
    ----------
    audio
        The audio file or session.
    labels
        A CSV file whose first line names the columns: ``time`` in s from the audio's beginning; ``contact``
        and ``slip`` (0 or 1), ``position`` in m from pickup 1, ``force`` in N, or any others, all numbers. An
        empty cell is unknown. With ``begin`` and ``end`` in place of ``time``, each row is a touch, and there
        is no contact between rows. None for no labels.
    out
        The new session, ``NAME.mcap``; on an error it is not left behind.
    described
        Options of `Description` by name, such as ``object`` and ``string``; the name defaults to the file's.
    allow_truncated
        Whether to read a truncated audio file, up to its end.

    Raises
    ------
    InputError
        If a file cannot be used (the error names the row and column of a table), or the session exists.

    >>> import tempfile, soundfile
    >>> from monochord.sessions import read_session
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sound, table = Path(folder) / "take.wav", Path(folder) / "take.csv"
    ...     soundfile.write(sound, np.zeros((44100, 2)), 44100)
    ...     _ = table.write_text("time,contact,position\n0.0,0,\n0.5,1,0.12\n")
    ...     from_files(sound, table, Path(folder) / "take.mcap", described={"object": "key"})
    ...     read_session(Path(folder) / "take.mcap").labels.columns["position"]
    array([ nan, 0.12])
    """
    options_ = dict(described or {})
    source, known, begin = AUDIO_FILES, dict[str, Any](), None
    options: dict[str, Any] = {"path": str(audio), **({"allow_truncated": True} if allow_truncated else {})}
    if audio.suffix.lower() == SESSION_SUFFIX:
        source = SESSIONS
        known, begin = _known(audio)
    with SOURCES.build(source, options).open() as probe:
        rate, channels = probe.signal.sample_rate, probe.signal.channels
        frames = max((block.start + block.samples.shape[1] for block in probe), default=0)
    more = {"imported": _text(audio.name), **({"imported_labels": _text(labels.name)} if labels else {})}
    tree: dict[str, Any] = {"name": _text(audio.stem), **known, **options_}
    tree |= {"sample_rate": rate, "channels": channels}
    more = known.get("more", {}) | more
    description = from_tree(Description, {**tree, "more": {**more, **options_.get("more", {})}}, "session")
    time, columns = np.zeros(0), dict[str, Floats]()
    if labels is not None:
        time, columns = read_labels(labels, frames / rate, description.string)
    if begin is None:
        begin = audio.stat().st_mtime_ns - round(frames / rate * 1e9)
    clock = SessionClock(epoch_ns=max(begin, 0))
    options["block"] = round(BLOCK * rate)
    writer = SessionWriter(out, description, clock)
    try:
        with writer, SOURCES.build(source, options).open() as stream:
            _write(writer, stream, time, columns)
    except BaseException:
        out.unlink(missing_ok=True)
        raise


def _known(path: Path) -> tuple[dict[str, Any], int]:
    """Return the description and begin in ns of a recorded session; refuses one with other streams."""
    session = read_session(path)
    streams = [name for name in session.streams if name not in (ESTIMATES, POSES)]
    streams += ["labels"] if session.labels.time.size else []
    if streams:
        given = f"session {path} with {' and '.join(streams)}"
        raise InputError(
            given, "a session of microphones alone", "run build on it, which labels it from these streams"
        )
    about = to_tree(session.description)
    for name in ("feeds", "sample_rate", "channels"):
        about.pop(name, None)
    return about, session.clock.epoch_ns


def _text(name: str) -> str:
    """Return a file's name as text; it may hold any bytes."""
    return os.fsencode(name).decode(errors="replace")


def _write(writer: SessionWriter, stream: Stream, time: Floats, columns: Mapping[str, Floats]) -> None:
    written = 0
    for block in stream:
        due = int(np.searchsorted(time, block.start / stream.signal.sample_rate))
        _labels(writer, time, columns, slice(written, due))
        written = due
        writer.audio(block)
        writer.flush()  # a file that is cut keeps what came before
    _labels(writer, time, columns, slice(written, None))


def _labels(writer: SessionWriter, time: Floats, columns: Mapping[str, Floats], part: slice) -> None:
    if len(time[part]) and columns:
        writer.labels(time[part], {name: column[part] for name, column in columns.items()})


def read_labels(
    path: Path, seconds: Seconds, string: StringParams | None = None
) -> tuple[Floats, dict[str, Floats]]:
    """Return times (n,) and columns (n,) by name; NaN where a cell is empty.

    The first line names the columns: ``time`` in s from the audio's beginning, and others, all numbers. Cells
    are separated by commas, semicolons or tabs. A table of touches, with ``begin`` and ``end``, is returned
    as labels every `TOUCH_STEP`.

    Raises `InputError`, which names the row and column, if the file is not such a table, a cell is not a
    number or out of range, a time is beyond the audio's `seconds` or before the previous one, or a position
    or force is impossible on the `string` (see `physics.known_touches`).
    """
    names, rows = _rows(path)
    table = ([_number(path, row, *cell) for cell in zip(names, cells, strict=True)] for row, cells in rows)
    cells = np.array([*table], dtype=np.float64).reshape(-1, len(names))
    numbers = [row for row, _ in rows]
    by_touch = "time" not in names
    when = TOUCH if by_touch else ("time",)
    times = cells[:, [names.index(name) for name in when]]
    _refuse_times(path, np.repeat(numbers, times.shape[1]).tolist(), times.ravel(), seconds)
    columns = {name: cells[:, place] for place, name in enumerate(names) if name not in when}
    for name, column in columns.items():
        low, high, allowed = LABEL_RANGES.get(name, (-math.inf, math.inf, ""))
        wrong = np.flatnonzero((column < low) | (column > high) | np.isinf(column))
        if len(wrong):
            given = f"file {path} row {numbers[wrong[0]]}, {name} {column[wrong[0]]:g}"
            raise InputError(given, allowed or "a finite number, or an empty cell")
    unknown = np.full(len(numbers), np.nan)
    position, force = columns.get("position", unknown), columns.get("force", unknown)
    if not by_touch:
        force = _pressing(force, columns.get("contact", np.ones(len(numbers))))
    wrong = why_impossible(position, force, string)
    if wrong is not None:
        row = "" if wrong.touch is None else f" row {numbers[wrong.touch]}"
        raise InputError(f"file {path}{row}, {wrong.given}", wrong.expected, wrong.remedy)
    return _of_touches(times, columns, seconds) if by_touch else (times[:, 0], columns)


def _pressing(force: Floats, contact: Floats) -> Floats:
    """Return the forces (n,) of touches, NaN elsewhere, without the force sensor's noise about zero.

    Forces that are negative on average are kept: they are not noise.
    """
    known = np.isfinite(force) & (contact != 0.0) & (force != 0.0)
    noise = force[known].sum() >= -0.5 * np.abs(force[known]).sum()
    return np.where(known & ((force > 0.0) | (not noise)), force, np.nan)


def _of_touches(
    touches: Floats, columns: Mapping[str, Floats], seconds: Seconds
) -> tuple[Floats, dict[str, Floats]]:
    """Return times and columns of touches from begin to end (n, 2)."""
    time = np.arange(0.0, seconds, TOUCH_STEP)
    touch = np.searchsorted(touches[:, 0], time, side="right") - 1
    contact = (touch >= 0) & (time < np.concatenate((touches[:, 1], [0.0]))[touch])
    labels = {
        name: np.where(contact, np.append(each, np.nan)[touch], np.nan) for name, each in columns.items()
    }
    return time, {"contact": contact.astype(np.float64), **labels}


def _rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the header and the nonempty rows, each with its number in the file."""
    allowed = "a CSV file whose first line names time and labels"
    refuse_endless(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            first = file.readline()
            file.seek(0)
            reader = csv.reader(file, delimiter=max(",;\t", key=first.count), strict=True)
            lines = [
                (number, line) for number, line in enumerate(reader, start=1) if any(map(str.strip, line))
            ]
    except OSError as error:
        remedy = similar_name(path) or "check its name"
        raise InputError(f"file {path} ({error.strerror})", allowed, remedy) from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise InputError(f"file {path} ({error})", allowed) from error
    if not lines:
        raise InputError(f"file {path} (empty)", allowed)
    cells = without_index([line for _, line in lines])
    lines = [(number, line) for (number, _), line in zip(lines, cells, strict=True)]
    names = [name.strip() for name in lines[0][1]]
    if "time" not in names and not {*TOUCH} <= {*names}:
        remedy = "name the time column 'time'"
        raise InputError(f"file {path} with columns {', '.join(names)}", "time and others", remedy)
    if len(set(names)) < len(names) or not all(names):
        raise InputError(f"file {path} with columns {', '.join(names)}", "a different name for each")
    for number, line in lines[1:]:
        if len(line) != len(names):
            given = f"file {path} row {number} of {len(line)} cells"
            raise InputError(given, f"{len(names)}, as in its first line")
    return names, lines[1:]


def _number(path: Path, row: int, name: str, cell: str) -> float:
    try:
        return float(cell) if cell.strip() else math.nan
    except ValueError:
        allowed = "a number, or an empty cell"
        raise InputError(f"file {path} row {row}, {name} '{cell.strip()}'", allowed) from None


def _refuse_times(path: Path, rows: list[int], time: Floats, seconds: Seconds) -> None:
    wrong = np.flatnonzero(~((time >= 0.0) & (time <= seconds + MAX_OVERHANG)))
    if len(wrong):
        given = f"file {path} row {rows[wrong[0]]}, time {time[wrong[0]]:g}"
        raise InputError(
            given, f"0 to {seconds:g} s, the length of the audio", "give times in s from its beginning"
        )
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back):
        given = f"file {path} row {rows[back[0] + 1]}, time {time[back[0] + 1]:g} after {time[back[0]]:g}"
        raise InputError(given, "times in order", "sort the rows")
