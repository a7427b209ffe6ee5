"""A folder per session in formats that any program opens: WAV, CSV and JSON."""

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import soundfile

from monochord.core.errors import InputError
from monochord.core.files import refuse_endless, similar_name, sound_written, without_index, written
from monochord.core.types import Audio
from monochord.core.units import Samples
from monochord.sessions import SessionReader
from monochord.sessions.description import SIMULATED_COMMENT
from monochord.sessions.exports._contents import (
    MAX_STRETCH,
    READING_COLUMNS,
    Columns,
    Stretch,
    checked,
    read_about,
    stretches,
    table_names,
    tables,
    write_about,
    write_back,
)
from monochord.sessions.exports.base import Export, folder_each

FORM = "wav_csv"
SOUND, STRETCHES = "audio.wav", "audio.csv"
FORMATS = ("WAV", "WAVEX", "RF64")
"""Accepted sound formats; the size of a file in any other format does not bound its length."""
MAX_WAV = 0xFFFF0000
"""Largest size of sound in a WAV file in bytes; longer sound is written as RF64."""
KINDS: dict[str, Any] = {
    **READING_COLUMNS,
    **dict.fromkeys(("start", "frames", "dropped", "timed", "device_frame"), np.int64),
    **dict.fromkeys(("kind", "text", "data"), str),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class WavCsv(Export):
    """A folder per session: audio.wav in 32-bit floats, tables as CSV, session.json; lossless.

    Lost frames are zeros in the WAV file, so that its time stays correct. ``audio.csv`` lists, for each
    stretch, its start, the number of frames lost before it, and the converter time of its first frame. Every
    instrument has a ``NAME.csv``; every session has ``labels.csv``, ``events.csv`` and ``clocks.csv``. All
    times are in s since the session's beginning; an unknown value is an empty cell. There are no options.
    """

    def write(self, sessions: Sequence[SessionReader], out: Path) -> list[Path]:
        """Write each session to a folder below `out` named after its file."""
        paths: list[Path] = []
        for session, folder in folder_each(sessions, out):
            paths += [_write_sound(session, folder), folder / STRETCHES]
            for name, columns in tables(session).items():
                paths.append(write_csv(folder / f"{name}.csv", columns))
            paths.append(write_about(session, FORM, folder))
        return paths

    def read(self, folder: Path, path: Path) -> None:
        """Convert an exported folder back into a session, the new file `path`."""
        description, clock = read_about(folder, FORM)
        tables_read: dict[str, Columns] = {}
        for name in table_names(description):
            file = folder / f"{name}.csv"
            tables_read[name] = checked(file, name, read_csv(file, KINDS), description)
        with _opened(folder / SOUND) as sound:
            if (sound.samplerate, sound.channels) != (description.sample_rate, description.channels):
                given = f"file {folder / SOUND} with {sound.channels} channels at {sound.samplerate} Hz"
                raise InputError(given, f"{description.channels} at {description.sample_rate} Hz")
            write_back(path, description, clock, _stretches(folder, sound), tables_read)


def _write_sound(session: SessionReader, folder: Path) -> Path:
    """Write sound and its table stretch by stretch: memory does not grow with the session's length."""
    path, description = folder / SOUND, session.description
    rows: list[tuple[Any, ...]] = []
    ends = [stretch.start + stretch.samples.shape[1] for stretch in stretches(session)]
    size = max(ends, default=0) * description.channels * 4
    form = "RF64" if size > MAX_WAV else "WAV"
    shape = (description.sample_rate, description.channels)
    with sound_written(path), soundfile.SoundFile(path, "w", *shape, "FLOAT", format=form) as sound:
        if description.simulated:
            sound.comment = SIMULATED_COMMENT
        for stretch in stretches(session):
            while stretch.start > sound.tell():
                lost = min(stretch.start - sound.tell(), MAX_STRETCH)
                sound.write(np.zeros((lost, description.channels), np.float32))
            sound.write(np.ascontiguousarray(stretch.samples.T))
            frames = stretch.samples.shape[1]
            beside = (stretch.timed, stretch.device_frame)
            rows.append((stretch.time, stretch.start, frames, stretch.dropped, *map(int, beside)))
    names = ("time", "start", "frames", "dropped", "timed", "device_frame")
    columns = zip(*rows, strict=True) if rows else [[] for _ in names]
    kinds = {name: KINDS.get(name, np.float64) for name in names}
    write_csv(
        folder / STRETCHES,
        {name: np.array(column, kinds[name]) for name, column in zip(names, columns, strict=True)},
    )
    return path


def _opened(path: Path) -> soundfile.SoundFile:
    allowed = "the exported WAV file"
    refuse_endless(path)
    try:
        file = soundfile.SoundFile(path)
    except (soundfile.LibsndfileError, OSError) as error:
        raise InputError(f"file {path} ({error})", allowed) from error
    if file.format not in FORMATS:
        file.close()
        raise InputError(f"file {path} of format {file.format}", allowed)
    return file


def _stretches(folder: Path, sound: soundfile.SoundFile) -> Iterator[Stretch]:
    path = folder / STRETCHES
    rows = read_csv(path, KINDS)
    names = ("time", "start", "frames", "dropped", "timed", "device_frame")
    if set(names) - set(rows):
        raise InputError(f"file {path} with {', '.join(rows) or 'no header'}", ", ".join(names))
    reached = 0
    for row, (time, start, frames, dropped, timed, device_frame) in enumerate(
        zip(*(rows[n].tolist() for n in names), strict=True), start=2
    ):
        if not (reached <= start <= start + frames <= sound.frames and frames <= MAX_STRETCH):
            given = f"file {path} row {row}, frames {start} to {start + frames}"
            allowed = f"frames of {SOUND}, {reached} to {sound.frames}, {MAX_STRETCH} at most"
            raise InputError(given, allowed, "order the rows, without overlap")
        reached = start + frames
        yield Stretch(
            start=start,
            dropped=dropped,
            time=time,
            timed=bool(timed),
            device_frame=device_frame,
            samples=_samples(folder / SOUND, sound, start, frames),
        )


def _samples(path: Path, sound: soundfile.SoundFile, start: Samples, frames: Samples) -> Audio:
    """Return frames (channels, n) of a file; raises `InputError` where the file is too short."""
    try:
        sound.seek(start)
        samples: Any = sound.read(frames, dtype="float32", always_2d=True)
    except soundfile.LibsndfileError as error:
        raise InputError(f"file {path} ({error})", "the exported WAV file") from error
    if len(samples) < frames:
        given = f"file {path} (ends after frame {start + len(samples)})"
        raise InputError(given, f"{sound.frames} frames, as its header states")
    return np.ascontiguousarray(samples.T)


def write_csv(path: Path, columns: Columns) -> Path:
    """Write a table; NaN is an empty cell. In a text column, everything but numbers is quoted."""
    texts = any(column.dtype.kind == "O" for column in columns.values())
    # Else a carriage return in a text would end its row.
    quoting = csv.QUOTE_NONNUMERIC if texts else csv.QUOTE_MINIMAL
    with written(path), path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n", quoting=quoting)
        writer.writerow(columns)
        cells = (_cells(column) for column in columns.values())
        writer.writerows(zip(*cells, strict=True))
    return path


def _cells(column: np.ndarray[Any, np.dtype[Any]]) -> list[Any]:
    if column.dtype.kind != "f":
        return column.tolist()
    return [None if math.isnan(value) else value for value in column.tolist()]


def read_csv(path: Path, kinds: Mapping[str, type]) -> Columns:
    """Read a table; columns are float64 except those named in `kinds`.

    Raises `InputError`, with the row, where one has the wrong length, or a cell the wrong type.
    """
    refuse_endless(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            names, *rows = without_index([*csv.reader(file, strict=True)] or [[]])
    except OSError as error:
        remedy = similar_name(path) or "check its name"
        raise InputError(f"file {path} ({error.strerror})", "a CSV file", remedy) from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise InputError(f"file {path} ({error})", "CSV in UTF-8") from error
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"file {path} with two columns '{twice}'", "unique names")
    for number, row in enumerate(rows, start=2):
        if len(row) != len(names):
            raise InputError(
                f"file {path} row {number} of {len(row)} cells", f"{len(names)}, as in its header"
            )
    return {
        name: _column(path, name, [row[place] for row in rows], kinds.get(name, float))
        for place, name in enumerate(names)
    }


def _column(path: Path, name: str, cells: list[str], kind: type) -> np.ndarray[Any, np.dtype[Any]]:
    if kind is str:
        return np.array(cells, dtype=object)
    number = int if issubclass(kind, np.integer) else float
    values: list[float] = []
    for row, cell in enumerate(cells, start=2):
        try:
            values.append(number(cell) if cell or number is int else math.nan)
        except ValueError:
            allowed = "a whole number" if number is int else "a number, or an empty cell where unknown"
            raise InputError(f"file {path} row {row}, {name} '{cell}'", allowed) from None
    try:
        return np.array(values, dtype=kind)
    except OverflowError:
        bounds = np.iinfo(kind)
        row, wrong = next((n, v) for n, v in enumerate(values, start=2) if not bounds.min <= v <= bounds.max)
        given = f"file {path} row {row}, {name} {wrong}"
        raise InputError(given, f"a whole number, {bounds.min} to {bounds.max}") from None
