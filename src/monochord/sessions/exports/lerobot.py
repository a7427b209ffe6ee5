"""A LeRobot dataset, format version 3.0: Parquet and JSON."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from monochord.core.errors import InputError
from monochord.core.files import written
from monochord.core.ranges import Count
from monochord.core.types import Floats
from monochord.sessions import SessionReader
from monochord.sessions.alignment import AUDIO, Alignment, align, aligned_readings
from monochord.sessions.exports.base import Export, arrow, new_folder

VERSION = "v3.0"
FILES_A_CHUNK = 1000
MEGABYTES = 100
"""Size of a data file in bytes, above which the next episode starts a new file."""
PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
DATA, EPISODES, TASKS = f"data/{PLACE}", f"meta/episodes/{PLACE}", "meta/tasks.parquet"
Frames: TypeAlias = dict[str, np.ndarray[Any, np.dtype[Any]]]
"""Features by name, (frames,) or (frames, values)."""
Stats: TypeAlias = dict[str, dict[str, np.ndarray[Any, np.dtype[Any]]]]
"""``min``, ``max``, ``mean``, ``std`` (values,) and ``count`` (1,) by feature."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeRobot(Export):
    """A LeRobot dataset, version 3.0: each session is an episode of `fps` frames a second.

    Frame k holds the audio of the k-th 1/`fps` s at full sample rate, as float32:
    ``observation.microphone_1``, ``_2`` and so on; LeRobot's delta_timestamps join frames into windows of any
    length. ``observation.state`` is each instrument's latest reading at the end of the frame, so no frame
    contains future data. ``label.NAME`` is the latest label, NaN where unknown. ``observation.gap`` is true
    where audio frames were lost. A session's task is `task` in its `more`, else it names the object. With
    `aligned`, readings count from when they were taken, with the stream offsets measured by taps removed (see
    `monochord.sessions.alignment`), and a session with alignment flags is refused unless `force` is set.
    Without `aligned`, readings count from when they arrived.

    The dataset leaves out: readings between frames; sequence, device time, status and arrival of readings;
    the converter's clock (a frame's time is k/`fps`, as LeRobot expects); events, clock offsets, the plan; an
    incomplete last frame; precision beyond float32. There is no ``action``: a session records where the robot
    was, not its command. All sessions must have the same microphones, instruments and labels.
    """

    fps: Count = 50
    aligned: bool = True
    force: bool = False

    def write(self, sessions: Sequence[SessionReader], out: Path) -> list[Path]:
        """Write the sessions as the dataset `out`, episode by episode in the given order."""
        pa, pq = arrow("lerobot")
        refuse_unlike(sessions)
        new_folder(out)
        tasks = list(dict.fromkeys(map(task_of, sessions)))
        data, rows, features = _DataFiles(pa, pq, out), list[dict[str, Any]](), dict[str, Any]()
        stats: list[Stats] = []
        for number, session in enumerate(sessions):
            task = tasks.index(task_of(session))
            frames = _numbered(
                frames_of(session, self.fps, aligned=self.aligned, force=self.force),
                self.fps,
                number,
                data.frames,
                task,
            )
            features = features or _features(frames, session)
            stats.append(stats_of(frames))
            place = data.add(frames)
            rows.append(_episode(number, [task_of(session)], place, stats[-1]))
        data.close()
        tables = {
            out / EPISODES.format(chunk_index=0, file_index=0): pa.Table.from_pylist(rows),
            out / TASKS: _tasks(pa, tasks),
        }
        for path, table in tables.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            with written(path):
                pq.write_table(table, path)
        paths = [*data.paths, *tables]
        info = _info(sessions, self.fps, data.frames, tasks, features)
        whole = {name: {k: v.tolist() for k, v in each.items()} for name, each in joined(stats).items()}
        for name, tree in (("info", info), ("stats", whole)):
            paths.append(out / "meta" / f"{name}.json")
            with written(paths[-1]):
                paths[-1].write_text(json.dumps(tree, indent=4, ensure_ascii=False), encoding="utf-8")
        return paths


class _DataFiles:
    """The frames of all episodes in sequence, in files of limited size."""

    def __init__(self, pa: Any, pq: Any, out: Path) -> None:
        self._pa, self._pq, self._out = pa, pq, out
        self._writer: Any = None
        self._size = 0.0
        self.frames = 0
        self.paths: list[Path] = []

    def add(self, frames: Frames) -> dict[str, int]:
        """Write an episode; return its position."""
        table = self._pa.table({name: _array(self._pa, column) for name, column in frames.items()})
        megabytes = table.nbytes / 2**20
        if self._writer is None or self._size + megabytes > MEGABYTES:
            self.close()
            chunk, file = divmod(len(self.paths), FILES_A_CHUNK)
            self.paths.append(self._out / DATA.format(chunk_index=chunk, file_index=file))
            self.paths[-1].parent.mkdir(parents=True, exist_ok=True)
            self._writer, self._size = self._pq.ParquetWriter(self.paths[-1], table.schema), 0.0
        with written(self.paths[-1]):
            self._writer.write_table(table)
        self._size += megabytes
        first, self.frames = self.frames, self.frames + table.num_rows
        chunk, file = divmod(len(self.paths) - 1, FILES_A_CHUNK)
        return {
            "data/chunk_index": chunk,
            "data/file_index": file,
            "dataset_from_index": first,
            "dataset_to_index": self.frames,
        }

    def close(self) -> None:
        if self._writer is not None:
            with written(self.paths[-1]):
                self._writer.close()
            self._writer = None


def _array(pa: Any, column: np.ndarray[Any, np.dtype[Any]]) -> Any:
    if column.ndim == 1:
        return pa.array(column)
    return pa.FixedSizeListArray.from_arrays(pa.array(column.ravel()), column.shape[1])


def _numbered(frames: Frames, fps: int, episode: int, first: int, task: int) -> Frames:
    """Return the frames with LeRobot's index columns."""
    count = len(next(iter(frames.values())))
    number = np.arange(count)
    return frames | {
        "timestamp": (number / fps).astype(np.float32),
        "frame_index": number,
        "episode_index": np.full(count, episode),
        "index": first + number,
        "task_index": np.full(count, task),
    }


def _features(frames: Frames, session: SessionReader) -> dict[str, Any]:
    names = {"observation.state": state_names(session)}
    return {
        name: {
            "dtype": str(column.dtype),
            "shape": [column.shape[1] if column.ndim > 1 else 1],
            "names": names.get(name),
        }
        for name, column in frames.items()
    }


def _episode(number: int, tasks: list[str], place: dict[str, int], stats: Stats) -> dict[str, Any]:
    row: dict[str, Any] = {
        "episode_index": number,
        "tasks": tasks,
        "length": place["dataset_to_index"] - place["dataset_from_index"],
        **place,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }
    places = {
        f"stats/{name}/{key}": value.tolist() for name, each in stats.items() for key, value in each.items()
    }
    return row | places


def _tasks(pa: Any, tasks: list[str]) -> Any:
    """Return the task table for pandas, which LeRobot reads it with, indexed by text."""
    kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, (kind, numpy) in kinds.items()
    ]
    layout = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
    table = pa.table(
        {"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())}
    )
    return table.replace_schema_metadata({"pandas": json.dumps(layout | {"pandas_version": "2.0.0"})})


def _info(
    sessions: Sequence[SessionReader], fps: int, frames: int, tasks: list[str], features: dict[str, Any]
) -> dict[str, Any]:
    simulated = any(session.description.simulated for session in sessions)
    return {
        "codebase_version": VERSION,
        "robot_type": "monochord (simulated)" if simulated else "monochord",
        "total_episodes": len(sessions),
        "total_frames": frames,
        "total_tasks": len(tasks),
        "chunks_size": FILES_A_CHUNK,
        "data_files_size_in_mb": MEGABYTES,
        "video_files_size_in_mb": 500,
        "fps": fps,
        "splits": {"train": f"0:{len(sessions)}"},
        "data_path": DATA,
        "video_path": None,
        "features": features,
    }


STATE, GAP, LABEL = "observation.state", "observation.gap", "label."
MAX_FPS = 200


def refuse_unlike(sessions: Sequence[SessionReader]) -> None:
    """Raise `InputError` where the sessions' features differ; all episodes share one set."""
    if not sessions:
        raise InputError("no session", "1 or more")
    forms = [_form(session) for session in sessions]
    for session, form in zip(sessions, forms, strict=True):
        for what, (ours, first) in {k: (form[k], forms[0][k]) for k in form}.items():
            if ours != first:
                given = f"session {session.path} with {what} {ours}"
                raise InputError(given, f"{first}, as {sessions[0].path} has", "export them separately")


def _form(session: SessionReader) -> dict[str, Any]:
    description = session.description
    names = {stream: description.feed(stream).columns for stream in session.streams}
    microphones = f"{description.channels} at {description.sample_rate} Hz"
    return {"microphones": microphones, "streams": names, "labels": sorted(session.labels.columns)}


def frames_of(session: SessionReader, fps: int, *, aligned: bool, force: bool = False) -> Frames:
    """Return a session's frames; raises `InputError` where a frame is not a whole number of samples.

    With `aligned`, readings count from when they were taken, with the stream offsets measured by taps
    removed; without it, from when they arrived. With `aligned`, a session with alignment flags is refused
    unless `force` is set.
    """
    audio = session.audio
    size, rest = divmod(audio.sample_rate, fps)
    if rest:
        fitting = (n for n in range(1, MAX_FPS + 1) if audio.sample_rate % n == 0)
        allowed = ", ".join(map(str, fitting)) + f" at {audio.sample_rate} Hz"
        raise InputError(
            f"{fps} frames a second", allowed, "choose fps so that a frame is a whole number of samples"
        )
    count = audio.samples.shape[1] // size
    if not count:
        raise InputError(f"session {session.path} (shorter than a frame)", f"{1 / fps:g} s or more")
    parts = audio.samples[:, : count * size].reshape(-1, count, size)
    frames: Frames = {f"observation.microphone_{n}": part for n, part in enumerate(parts, start=1)}
    frames[GAP] = np.zeros(count, dtype=bool)
    for first, stop in audio.gaps:
        frames[GAP][first // size : -(-stop // size)] = True
    ends = audio.time(size * np.arange(1, count + 1))
    alignment = align(session) if aligned and session.streams else None
    if alignment and alignment.flags and not force:
        first, *others = alignment.flags
        given = f"session {session.path}: {first}" + (f" (and {len(others)} more)" if others else "")
        raise InputError(given, "streams on one clock", "leave it out, or set force=true or aligned=false")
    when = ends if alignment is None else alignment.correct(AUDIO, ends)
    states = [_latest(session, stream, when, alignment) for stream in session.streams]
    if states:
        with np.errstate(over="ignore"):  # what float32 does not hold is infinite there
            state = np.concatenate(states, axis=1).astype(np.float32)
        frames[STATE] = state if state.shape[1] > 1 else state[:, 0]
    labels = session.labels
    for name, column in sorted(labels.columns.items()):
        if len(labels.time):
            latest = np.searchsorted(np.maximum.accumulate(labels.time), when, side="right") - 1
            values = np.where(latest < 0, np.nan, column[np.maximum(latest, 0)])
            frames[LABEL + name] = values.astype(np.float32)
    return frames


def state_names(session: SessionReader) -> list[str]:
    """Return the names of the state's elements."""
    feeds = (session.description.feed(stream) for stream in session.streams)
    return [f"{feed.stream}.{column}" for feed in feeds for column in feed.columns]


def _latest(session: SessionReader, stream: str, at: Floats, alignment: Alignment | None) -> Floats:
    """Return the latest reading at each time, never a future one; before the first reading, the first one."""
    bare = alignment is None
    track = session.readings(stream) if bare else aligned_readings(session, stream, alignment)
    if not len(track.time):
        allowed = "at least one reading of each stream"
        raise InputError(f"stream '{stream}' of session {session.path} (empty)", allowed)
    latest = np.searchsorted(np.maximum.accumulate(track.time), at, side="right") - 1
    return track.values[np.maximum(latest, 0)]


def task_of(session: SessionReader) -> str:
    """Return the episode's task description."""
    description = session.description
    touched = "touch the string" + (f" with {description.object}" if description.object else "")
    return description.more.get("task", touched)


def stats_of(frames: Frames) -> Stats:
    """Return an episode's statistics; a value that is never known has NaN and `count` 0."""
    with np.errstate(invalid="ignore"):  # of what is infinite
        return {name: _of(column.reshape(len(column), -1).astype(float)) for name, column in frames.items()}


def _of(column: np.ndarray[Any, np.dtype[np.float64]]) -> dict[str, Any]:
    known = column[~np.isnan(column).any(axis=1)]
    width = np.full(column.shape[1], np.nan)
    if not len(known):
        return {"min": width, "max": width, "mean": width, "std": width, "count": np.array([0])}
    return {
        "min": known.min(axis=0),
        "max": known.max(axis=0),
        "mean": known.mean(axis=0),
        "std": known.std(axis=0),
        "count": np.array([len(known)]),
    }


def joined(episodes: Sequence[Stats]) -> Stats:
    """Return the statistics of all episodes, merged from each episode's (Chan et al. 1979)."""
    stats: Stats = {}
    for name in episodes[0]:
        parts = [each[name] for each in episodes if each[name]["count"][0]] or [episodes[0][name]]
        counts = np.array([part["count"][0] for part in parts], dtype=np.float64)
        weights = (counts / max(counts.sum(), 1.0))[:, None]
        means = np.stack([part["mean"] for part in parts])
        mean = (weights * means).sum(axis=0)
        spread = np.stack([part["std"] for part in parts]) ** 2 + (means - mean) ** 2
        stats[name] = {
            "min": np.min([part["min"] for part in parts], axis=0),
            "max": np.max([part["max"] for part in parts], axis=0),
            "mean": mean,
            "std": np.sqrt((weights * spread).sum(axis=0)),
            "count": np.array([int(counts.sum())]),
        }
    return stats
