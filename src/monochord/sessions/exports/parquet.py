"""A folder of Parquet files per session, one per stream."""

import signal
import subprocess
import sys
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.files import written
from monochord.core.units import Seconds
from monochord.sessions import Description, SessionReader
from monochord.sessions.bounds import MAX_COLUMNS, refuse_unpacking
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
from monochord.sessions.exports.base import Export, arrow, folder_each

FORM = "parquet"
ROWS = 64
"""Stretches of audio in memory at once, some seconds."""
CHECKED = {"write_page_checksum": True}
"""Verify page checksums on reading; without them, damage would read as wrong values."""
MAX_TABLE_COLUMNS = MAX_COLUMNS + len(READING_COLUMNS) + 1
"""Columns of a file: the stream's columns, the auxiliary columns, and the times."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parquet(Export):
    """A folder per session: audio.parquet, one file per instrument, labels, events, clocks; lossless.

    A row of ``audio.parquet`` is a stretch of consecutive frames, some 0.1 s: ``start`` is the index of its
    first frame, ``dropped`` the number of frames lost before it, and ``channel_1`` ... hold the samples as
    float32. The other files have one row per reading (label, event) and one column per quantity, with times
    in s since the session's beginning. ``session.json`` holds the rest. `compression` is zstd, snappy, gzip
    or none.
    """

    compression: str = "zstd"

    def write(self, sessions: Sequence[SessionReader], out: Path) -> list[Path]:
        """Write each session to a folder below `out` named after its file."""
        known = ("zstd", "snappy", "gzip", "none")
        if self.compression not in known:
            raise InputError(f"compression '{self.compression}'", ", ".join(known))
        pa, pq = arrow(FORM)
        paths: list[Path] = []
        for session, folder in folder_each(sessions, out):
            paths.append(self._write_audio(pa, pq, session, folder / "audio.parquet"))
            for name, columns in tables(session).items():
                path = folder / f"{name}.parquet"
                # The type of text is given, since a table without rows would not have it.
                texts = {key: pa.string() for key, column in columns.items() if column.dtype.kind == "O"}
                arrays = {key: pa.array(column, texts.get(key)) for key, column in columns.items()}
                with written(path):
                    pq.write_table(pa.table(arrays), path, compression=self.compression, **CHECKED)
                paths.append(path)
            paths.append(write_about(session, FORM, folder))
        return paths

    def read(self, folder: Path, path: Path) -> None:
        """Convert an exported folder back into a session, the new file `path`."""
        pa, pq = arrow(FORM)
        description, clock = read_about(folder, FORM)
        names = table_names(description)
        _refuse_deadly([file for file in folder.glob("*.parquet") if file.stem in {*names, "audio"}])
        tables_read: dict[str, Columns] = {}
        for name in names:
            tables_read[name] = _table_of(pa, pq, folder / f"{name}.parquet", name, description)
        path_of_audio, schema = folder / "audio.parquet", _audio_schema(pa, description.channels)
        with _opened(pa, pq, path_of_audio) as file:
            if tuple(file.schema_arrow.names) != tuple(schema.names):
                given = f"file {path_of_audio} with {', '.join(file.schema_arrow.names)}"
                raise InputError(given, ", ".join(schema.names))
            _refuse_groups(pa, path_of_audio, file.metadata)
            write_back(path, description, clock, _stretches(pa, file, path_of_audio, schema), tables_read)

    def _write_audio(self, pa: Any, pq: Any, session: SessionReader, path: Path) -> Path:
        schema = _audio_schema(pa, session.description.channels)
        rows: list[dict[str, Any]] = []
        with written(path), pq.ParquetWriter(path, schema, compression=self.compression, **CHECKED) as writer:
            for stretch in stretches(session):
                rows.append(_row(stretch))
                if len(rows) == ROWS:
                    writer.write_table(_table(pa, schema, rows))
                    rows = []
            writer.write_table(_table(pa, schema, rows))
        return path


def _audio_schema(pa: Any, channels: int) -> Any:
    kinds = {
        "time": pa.float64(),
        "start": pa.int64(),
        "dropped": pa.int64(),
        "timed": pa.bool_(),
        "device_frame": pa.int64(),
    }
    samples = {f"channel_{number}": pa.list_(pa.float32()) for number in range(1, channels + 1)}
    return pa.schema(list({**kinds, **samples}.items()))


def _row(stretch: Stretch) -> dict[str, Any]:
    names = ("time", "start", "dropped", "timed", "device_frame")
    channels = {f"channel_{number}": each for number, each in enumerate(stretch.samples, start=1)}
    return {name: getattr(stretch, name) for name in names} | channels


def _table(pa: Any, schema: Any, rows: list[dict[str, Any]]) -> Any:
    return pa.table({name: [row[name] for row in rows] for name in schema.names}, schema=schema)


def _stretches(pa: Any, file: Any, path: Path, schema: Any) -> Iterator[Stretch]:
    row = 0
    with _readable(pa, path):
        batches = file.iter_batches(batch_size=ROWS)
    while True:
        with _readable(pa, path):
            batch = next(batches, None)
            if batch is None:
                return
            rows = _columns(pa, path, batch, schema)
        for columns in zip(*rows.values(), strict=True):
            row_values = dict(zip(rows, columns, strict=True))
            samples = [row_values.pop(name) for name in schema.names if name.startswith("channel_")]
            frames = len(samples[0])
            if any(len(each) != frames for each in samples) or frames > MAX_STRETCH:
                given = f"file {path} row {row}, with {', '.join(str(len(each)) for each in samples)} samples"
                raise InputError(given, f"as many in each channel, {MAX_STRETCH} at most")
            row += 1
            yield Stretch(samples=np.stack(samples), **row_values)


def _columns(pa: Any, path: Path, batch: Any, schema: Any) -> dict[str, list[Any]]:
    """Return the columns of a batch of audio: a value or an array of samples for each row."""
    table = pa.Table.from_batches([batch]).cast(schema).combine_chunks()
    table.validate(full=True)
    cells: dict[str, list[Any]] = {}
    for name in schema.names:
        column = table[name]
        lists = pa.types.is_list(column.type)
        if column.null_count or (lists and any(part.flatten().null_count for part in column.chunks)):
            raise InputError(f"file {path}, column {name} with empty cells", "a value in each")
        cells[name] = [each.values.to_numpy() for each in column] if lists else column.to_pylist()
    return cells


def _table_of(pa: Any, pq: Any, path: Path, name: str, description: Description) -> Columns:
    """Return a session table other than the audio."""
    with _opened(pa, pq, path) as file:
        names, rows = file.schema_arrow.names, file.metadata.num_rows
        if len(set(names)) < len(names) or len(names) > MAX_TABLE_COLUMNS:
            given = f"file {path} with {len(names)} columns"
            raise InputError(given, f"{MAX_TABLE_COLUMNS} at most, with unique names")
        claimed = 8 * max(rows, 0) * len(names)
        refuse_unpacking(f"file {path}", path.stat().st_size, claimed, "export the session again")
        _refuse_groups(pa, path, file.metadata)
        with _readable(pa, path):
            table = file.read()
            table.validate(full=True)
            texts = {"kind", "text", "data"} if name == "events" else set[str]()
            columns: Columns = {}
            for key in names:
                column = table[key].cast(pa.string()) if key in texts else table[key]
                if column.null_count and (key in texts or not pa.types.is_floating(column.type)):
                    raise InputError(f"file {path}, column {key} with empty cells", "a value in each")
                columns[key] = column.to_numpy()
    return checked(path, name, columns, description)


def _refuse_groups(pa: Any, path: Path, metadata: Any) -> None:
    """Refuse row groups that claim far more values than their bytes can hold, before memory is allocated."""
    for number in range(metadata.num_row_groups):
        group = metadata.row_group(number)
        for place in range(group.num_columns):
            column = group.column(place)
            packed, values = max(column.total_compressed_size, 0), max(column.num_values, 0)
            with _readable(pa, path):
                what = f"file {path}, column {column.path_in_schema}"  # which need not be UTF-8
            refuse_unpacking(what, packed, 8 * values, "export the session again")
            refuse_unpacking(what, packed, column.total_uncompressed_size, "export the session again")


@contextmanager
def _opened(pa: Any, pq: Any, path: Path) -> Generator[Any]:
    with _readable(pa, path):
        file = pq.ParquetFile(path, page_checksum_verification=True)
    with file:
        with _readable(pa, path):
            _ = file.schema_arrow.names  # which need not be UTF-8
        yield file


READ_TIMEOUT: Seconds = 60.0
"""Time in which the column descriptions of all files must be read, in s; usually it takes less than one."""
READ_METADATA = """
import sys, pyarrow.parquet
for number, path in enumerate(sys.argv[1:]):
    print(number, flush=True)
    try:
        pyarrow.parquet.read_metadata(path).to_dict()
    except Exception:
        pass
"""


def _refuse_deadly(paths: Sequence[Path]) -> None:
    """Refuse a file whose column descriptions crash the reading process, as in pyarrow 26, or hold it up.

    A separate process reads them first, for `READ_TIMEOUT` at most.
    """
    command = [sys.executable, "-c", READ_METADATA, *map(str, paths)]
    try:
        ended = subprocess.run(command, capture_output=True, check=False, timeout=READ_TIMEOUT)  # noqa: S603  (this interpreter)  # nosec B603
    except subprocess.TimeoutExpired as error:
        read = (error.stdout or b"").split()
        given = f"file {paths[int(read[-1]) if read else 0]} (its columns are not read in {READ_TIMEOUT:g} s)"
        raise InputError(given, "the exported Parquet file", "export the session again") from None
    if -ended.returncode in (signal.SIGABRT, signal.SIGSEGV):
        given = f"file {paths[int(ended.stdout.split()[-1])]} (its columns are described wrongly)"
        raise InputError(given, "the exported Parquet file")


@contextmanager
def _readable(pa: Any, path: Path) -> Generator[None]:
    """Raise the library's errors as `InputError` that names the file."""
    try:
        yield
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        raise InputError(f"file {path} ({error})", "the exported Parquet file") from error
