"""A folder of Parquet files a session, one a stream."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from monochord.errors import InputError
from monochord.exports._arrow import arrow
from monochord.exports._contents import (
    ABOUT,
    Columns,
    Stretch,
    about,
    columns_of,
    read_about,
    stretches,
    table_names,
    tables,
    write_back,
)
from monochord.exports._folders import folder_each
from monochord.exports.base import Export
from monochord.sessions import Session

FORM = "parquet"
ROWS = 64
"""Stretches of audio, some seconds of it, that are held in memory at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parquet(Export):
    """A folder a session: audio.parquet, one file an instrument, labels, events, clocks; nothing is lost.

    A row of ``audio.parquet`` is a stretch of frames that follow each other, some 0.1 s: ``start`` is the
    index of its first frame, ``dropped`` how many were lost before it, ``channel_1`` ... hold the samples as
    float32. The other files have a row a reading (label, event) and a column a quantity, times in s since the
    session's begin; ``session.json`` tells the rest. `compression` is zstd, snappy, gzip or none.
    """

    compression: str = "zstd"

    def write(self, sessions: Sequence[Session], out: Path) -> list[Path]:
        """Write each session to a folder of its file's name below `out`."""
        known = ("zstd", "snappy", "gzip", "none")
        if self.compression not in known:
            raise InputError(f"compression '{self.compression}'", ", ".join(known))
        pa, pq = arrow(FORM)
        written: list[Path] = []
        for session, folder in folder_each(sessions, out):
            written.append(self._write_audio(pa, pq, session, folder / "audio.parquet"))
            for name, columns in tables(session).items():
                path = folder / f"{name}.parquet"
                # Text is told to be text, or a table without rows would not know.
                texts = {key: pa.string() for key, column in columns.items() if column.dtype.kind == "O"}
                arrays = {key: pa.array(column, texts.get(key)) for key, column in columns.items()}
                pq.write_table(pa.table(arrays), path, compression=self.compression)
                written.append(path)
            text = json.dumps(about(session, FORM), indent=1, sort_keys=True, ensure_ascii=False)
            (folder / ABOUT).write_text(text + "\n", encoding="utf-8")
            written.append(folder / ABOUT)
        return written

    def read(self, folder: Path, path: Path) -> None:
        """Write the session that a folder holds to the new file `path`."""
        pa, pq = arrow(FORM)
        description, clock = read_about(folder, FORM)
        held: dict[str, Columns] = {}
        for name in table_names(description):
            table = _read(pa, pq, folder / f"{name}.parquet").read()
            held[name] = {key: table[key].to_numpy() for key in table.column_names}
            needed = columns_of(name, description)
            if not set(needed) <= set(held[name]):
                missing = ", ".join(sorted(set(needed) - set(held[name])))
                given = f"file {folder / name}.parquet without {missing}"
                raise InputError(given, ", ".join(needed))
        file = _read(pa, pq, folder / "audio.parquet")
        needed = tuple(_audio_schema(pa, description.channels).names)
        if tuple(file.schema_arrow.names) != needed:
            given = f"file {folder / 'audio.parquet'} with {', '.join(file.schema_arrow.names)}"
            raise InputError(given, ", ".join(needed))
        write_back(path, description, clock, _stretches(file, description.channels), held)

    def _write_audio(self, pa: Any, pq: Any, session: Session, path: Path) -> Path:
        schema = _audio_schema(pa, session.description.channels)
        rows: list[dict[str, Any]] = []
        with pq.ParquetWriter(path, schema, compression=self.compression) as writer:
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


def _stretches(file: Any, channels: int) -> Iterator[Stretch]:
    for batch in file.iter_batches(batch_size=ROWS):
        table = {name: batch.column(name) for name in batch.schema.names}
        for row in range(batch.num_rows):
            each = [table[f"channel_{number}"][row].values.to_numpy() for number in range(1, channels + 1)]
            yield Stretch(
                start=table["start"][row].as_py(),
                dropped=table["dropped"][row].as_py(),
                time=table["time"][row].as_py(),
                timed=table["timed"][row].as_py(),
                device_frame=table["device_frame"][row].as_py(),
                samples=np.stack(each),
            )


def _read(pa: Any, pq: Any, path: Path) -> Any:
    try:
        return pq.ParquetFile(path)
    except (OSError, pa.ArrowInvalid) as error:
        raise InputError(f"file {path} ({error})", "the Parquet file that was exported") from error
