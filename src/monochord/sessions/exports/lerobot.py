"""A data set for LeRobot, version 3.0 of its form: Parquet and JSON."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.sessions import Session
from monochord.sessions.exports._arrow import arrow
from monochord.sessions.exports._folders import new_folder
from monochord.sessions.exports._lerobot_frames import Frames, frames_of, refuse_unlike, state_names, task_of
from monochord.sessions.exports._lerobot_stats import Stats, joined, stats_of
from monochord.sessions.exports.base import Export

VERSION = "v3.0"
FILES_A_CHUNK = 1000
MEGABYTES = 100
"""Of a data file, above which the next episode begins another."""
PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
DATA, EPISODES, TASKS = f"data/{PLACE}", f"meta/episodes/{PLACE}", "meta/tasks.parquet"


@dataclass(frozen=True, slots=True, kw_only=True)
class LeRobot(Export):
    """A LeRobot data set, version 3.0: a session is an episode, cut into `fps` frames a second.

    Frame k holds the audio of the k-th 1/`fps` s, whole and as it was sampled: ``observation.microphone_1``
    and on, as float32; put together by LeRobot's delta_timestamps they make windows of any length.
    ``observation.state`` is the latest reading of each instrument at the end of that stretch, so that no
    frame knows what was still to come; ``label.NAME`` is the latest label there, NaN where it is not known;
    ``observation.gap`` tells whether frames of the audio were lost. A session's task is its ``task`` under
    `more`, or names its object. With `aligned`, readings count from when they were taken and offsets between
    the streams that taps tell of are taken off (see `monochord.sessions.alignment`), and a session that its
    alignment warns of is refused unless `force` is set; without it, readings count from when they arrived.

    What is left out: readings between the frames; sequence, device time and status of readings, their
    arrival and the converter's clock (a frame's time is k/`fps`, as LeRobot has it); events, clock offsets,
    the plan; the last part of a frame, and digits beyond float32. There is no ``action``: a session knows
    where the robot was, not what it was told. All sessions must have the same microphones, instruments and
    labels.
    """

    fps: int = 50
    aligned: bool = True
    force: bool = False

    def write(self, sessions: Sequence[Session], out: Path) -> list[Path]:
        """Write the sessions as the data set `out`, episode by episode in the order given."""
        if self.fps < 1:
            raise InputError(f"{self.fps} frames a second", "1 or more")
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
        written = [*data.paths, out / EPISODES.format(chunk_index=0, file_index=0), out / TASKS]
        for path in written[-2:]:
            path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(pa.Table.from_pylist(rows), written[-2])
        pq.write_table(_tasks(pa, tasks), written[-1])
        info = _info(sessions, self.fps, data.frames, tasks, features)
        whole = {name: {k: v.tolist() for k, v in each.items()} for name, each in joined(stats).items()}
        for name, tree in (("info", info), ("stats", whole)):
            written.append(out / "meta" / f"{name}.json")
            written[-1].write_text(json.dumps(tree, indent=4, ensure_ascii=False), encoding="utf-8")
        return written


class _DataFiles:
    """The frames of all episodes, one after the other in files of limited size."""

    def __init__(self, pa: Any, pq: Any, out: Path) -> None:
        self._pa, self._pq, self._out = pa, pq, out
        self._writer: Any = None
        self._size = 0.0
        self.frames = 0
        self.paths: list[Path] = []

    def add(self, frames: Frames) -> dict[str, int]:
        """Write an episode; return where it is."""
        table = self._pa.table({name: _array(self._pa, column) for name, column in frames.items()})
        megabytes = table.nbytes / 2**20
        if self._writer is None or self._size + megabytes > MEGABYTES:
            self.close()
            chunk, file = divmod(len(self.paths), FILES_A_CHUNK)
            self.paths.append(self._out / DATA.format(chunk_index=chunk, file_index=file))
            self.paths[-1].parent.mkdir(parents=True, exist_ok=True)
            self._writer, self._size = self._pq.ParquetWriter(self.paths[-1], table.schema), 0.0
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
            self._writer.close()
            self._writer = None


def _array(pa: Any, column: np.ndarray[Any, np.dtype[Any]]) -> Any:
    if column.ndim == 1:
        return pa.array(column)
    return pa.FixedSizeListArray.from_arrays(pa.array(column.ravel()), column.shape[1])


def _numbered(frames: Frames, fps: int, episode: int, first: int, task: int) -> Frames:
    """Return the frames with the columns that LeRobot counts by."""
    count = len(next(iter(frames.values())))
    number = np.arange(count)
    return frames | {
        "timestamp": (number / fps).astype(np.float32),
        "frame_index": number,
        "episode_index": np.full(count, episode),
        "index": first + number,
        "task_index": np.full(count, task),
    }


def _features(frames: Frames, session: Session) -> dict[str, Any]:
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
    told = {
        f"stats/{name}/{key}": value.tolist() for name, each in stats.items() for key, value in each.items()
    }
    return row | told


def _tasks(pa: Any, tasks: list[str]) -> Any:
    """Return the table of tasks; pandas, through which LeRobot reads it, is told that text is its index."""
    kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, (kind, numpy) in kinds.items()
    ]
    told = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
    table = pa.table(
        {"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())}
    )
    return table.replace_schema_metadata({"pandas": json.dumps(told | {"pandas_version": "2.0.0"})})


def _info(
    sessions: Sequence[Session], fps: int, frames: int, tasks: list[str], features: dict[str, Any]
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
