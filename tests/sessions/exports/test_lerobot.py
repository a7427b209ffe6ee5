"""The reader's side of the form, after the rules of LeRobot 0.4: what it looks up, and where."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.sessions.made import plain_readings

from monochord.core.errors import InputError
from monochord.core.types import WRENCH, Block, Feed
from monochord.sessions import Description, SessionClock, SessionReader, SessionWriter, read_session
from monochord.sessions.exports import lerobot
from monochord.sessions.exports.lerobot import LeRobot

RATE, FPS = 16000, 50
FEED = Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=1000.0)


def session(path: Path, *, seconds: float = 1.01, frames_lost: int = 0, **described: Any) -> SessionReader:
    """A session whose force in N is its time in s, and whose microphones count its frames."""
    described = {"name": path.stem, "sample_rate": RATE, "feeds": (FEED,), "object": "plastic", **described}
    clock = SessionClock(epoch_ns=10**18, origin=5.0)
    with SessionWriter(path, Description(**described), clock) as writer:
        start = dropped = 0
        lost_after = {1600: frames_lost}
        while start < seconds * RATE:
            count = np.arange(start, start + 160, dtype=np.float32)
            samples = np.stack([count, -count])[: described.get("channels", 2)]
            writer.audio(Block(samples=samples, start=start, dropped=dropped, adc_time=5.0 + start / RATE))
            dropped = lost_after.get(start, 0)
            start += 160 + dropped
        time = 5.0 + np.arange(round(seconds * 1000)) / 1000
        values = np.zeros((len(time), 6))
        values[:, 2] = time - 5.0
        for feed in described["feeds"]:
            writer.readings(plain_readings(feed.stream, time, values))
        position = np.where(time < 5.5, np.nan, 0.1)
        writer.labels(time, {"contact": (time >= 5.5).astype(np.float64), "position": position})
    return read_session(path)


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> list[SessionReader]:
    """Three episodes of two tasks."""
    tmp_path = tmp_path_factory.mktemp("takes")
    return [
        session(tmp_path / "a.mcap"),
        session(tmp_path / "b.mcap", seconds=0.5, frames_lost=320),
        session(tmp_path / "c.mcap", seconds=0.7, object="", more={"task": "rest"}),
    ]


def load(root: Path) -> tuple[dict[str, Any], pa.Table, list[dict[str, Any]]]:
    """Return info, all frames and all episodes, found as LeRobot finds them."""
    info = json.loads((root / "meta/info.json").read_text())
    data = pa.concat_tables([pq.read_table(path) for path in sorted((root / "data").glob("*/*.parquet"))])
    episodes = pa.concat_tables(
        [pq.read_table(path) for path in sorted((root / "meta/episodes").glob("*/*.parquet"))]
    )
    return info, data, episodes.to_pylist()


@pytest.fixture(scope="module")
def written(takes: list[SessionReader], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Their dataset, to be read alone."""
    out = tmp_path_factory.mktemp("written") / "set"
    LeRobot(fps=FPS, force=True).write(takes, out)
    return out


ARROW = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}


def test_features_match_their_description(written: Path) -> None:
    info, data, episodes = load(written)
    assert info["codebase_version"] == "v3.0"
    assert info["fps"] == FPS
    assert set(data.column_names) == set(info["features"])
    counted = {
        "timestamp": "float32",
        **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64"),
    }
    for name, feature in info["features"].items():
        kind, (size,) = ARROW[feature["dtype"]], feature["shape"]
        assert data.schema.field(name).type == (kind if size == 1 else pa.list_(kind, size))
        assert feature["names"] is None or len(feature["names"]) == size
        assert "/" not in name
    assert all(
        info["features"][name] == {"dtype": kind, "shape": [1], "names": None}
        for name, kind in counted.items()
    )
    assert info["features"]["observation.state"]["names"][2] == "wrench.fz"
    assert info["total_frames"] == data.num_rows == sum(episode["length"] for episode in episodes)
    assert info["total_episodes"] == len(episodes) == 3
    assert info["splits"] == {"train": "0:3"}


def test_an_episode_is_where_its_row_says(written: Path) -> None:
    info, data, episodes = load(written)
    assert data["index"].to_pylist() == list(range(data.num_rows))
    tasks = pq.read_table(written / "meta/tasks.parquet").to_pydict()
    metadata = json.loads(pq.read_schema(written / "meta/tasks.parquet").metadata[b"pandas"])
    assert metadata["index_columns"] == ["task"]
    assert info["total_tasks"] == len(tasks["task"]) == 2
    reached = 0
    for number, episode in enumerate(episodes):
        first, stop = episode["dataset_from_index"], episode["dataset_to_index"]
        assert (episode["episode_index"], first, stop - first) == (number, reached, episode["length"])
        reached = stop
        part = data.slice(first, stop - first)
        assert set(part["episode_index"].to_pylist()) == {number}
        assert part["frame_index"].to_pylist() == list(range(stop - first))
        np.testing.assert_allclose(part["timestamp"].to_numpy(), np.arange(stop - first) / FPS, atol=1e-6)
        (task,) = episode["tasks"]
        assert set(part["task_index"].to_pylist()) == {tasks["task_index"][tasks["task"].index(task)]}
        place = {key: episode[f"data/{key}"] for key in ("chunk_index", "file_index")}
        table = pq.read_table(written / info["data_path"].format(**place))
        assert number in table["episode_index"].to_pylist()
    assert tasks["task"] == ["touch the string with plastic", "rest"]


def test_frames_hold_all_audio_and_no_reading_of_the_future(
    takes: list[SessionReader], written: Path
) -> None:
    _, data, episodes = load(written)
    for take, episode in zip(takes, episodes, strict=True):
        part = data.slice(episode["dataset_from_index"], episode["length"])
        for number, samples in enumerate(take.audio.samples, start=1):
            joined = part[f"observation.microphone_{number}"].combine_chunks().flatten().to_numpy()
            np.testing.assert_array_equal(joined, samples[: len(joined)])
            assert len(samples) - len(joined) < RATE / FPS
        ends = (np.arange(episode["length"]) + 1) / FPS
        force = np.array(part["observation.state"].to_pylist())[:, 2]
        late = ends - force
        assert late.min() > -1e-6
        assert late[:-1].max() < 0.0011
        position, contact = part["label.position"].to_numpy(), part["label.contact"].to_numpy()
        np.testing.assert_array_equal(np.isnan(position), contact == 0.0)
    gaps = data["observation.gap"].to_numpy()
    assert gaps.sum() == 2  # the 320 that were lost lie across two frames of 320
    assert gaps[episodes[1]["dataset_from_index"] + 5]


def test_statistics_are_those_of_the_frames(written: Path) -> None:
    info, data, episodes = load(written)
    stats = json.loads((written / "meta/stats.json").read_text())
    assert set(stats) == set(info["features"])
    assert set(stats["timestamp"]) == {"min", "max", "mean", "std", "count"}
    for name, feature in info["features"].items():
        column = np.array(data[name].to_pylist(), dtype=np.float64).reshape(data.num_rows, -1)
        known = column[~np.isnan(column).any(axis=1)]
        for key, expected in {
            "min": known.min(axis=0),
            "max": known.max(axis=0),
            "mean": known.mean(axis=0),
            "std": known.std(axis=0),
        }.items():
            assert np.shape(stats[name][key]) == tuple(feature["shape"])
            np.testing.assert_allclose(stats[name][key], expected, rtol=1e-6, atol=1e-6)
        assert stats[name]["count"] == [len(known)]
        assert all(f"stats/{name}/{key}" in episodes[0] for key in stats[name])
    assert episodes[1]["stats/label.position/count"] == [0]


def test_a_file_that_is_full_is_followed_by_another(
    takes: list[SessionReader], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lerobot, "MEGABYTES", 0.01)
    monkeypatch.setattr(lerobot, "FILES_A_CHUNK", 2)
    written = LeRobot(force=True).write(takes, tmp_path / "set")
    names = ["chunk-000/file-000", "chunk-000/file-001", "chunk-001/file-000"]
    assert written[:3] == [tmp_path / f"set/data/{name}.parquet" for name in names]
    _, _, episodes = load(tmp_path / "set")
    assert [(e["data/chunk_index"], e["data/file_index"]) for e in episodes] == [(0, 0), (0, 1), (1, 0)]


def test_a_session_of_one_microphone_and_no_instrument(tmp_path: Path) -> None:
    LeRobot(force=True).write([session(tmp_path / "a.mcap", channels=1, feeds=())], tmp_path / "set")
    info, _, _ = load(tmp_path / "set")
    assert "observation.state" not in info["features"]
    assert "observation.microphone_2" not in info["features"]


def test_what_does_not_fit_is_refused(takes: list[SessionReader], tmp_path: Path) -> None:
    def refuse(match: str, *sessions: SessionReader, fps: int = 50, force: bool = True) -> None:
        with pytest.raises(InputError, match=match):
            LeRobot(fps=fps, force=force).write(sessions, tmp_path / "refused")

    refuse("^30 frames.* 1, 2, 4, 5, ", takes[0], fps=30)
    refuse("fps' = 0", takes[0], fps=0)
    refuse("no session")
    refuse("d.mcap", session(tmp_path / "d.mcap", seconds=0.01))
    refuse("microphones 1 .*2 .*a.mcap", takes[0], session(tmp_path / "e.mcap", channels=1))
    refuse("streams {}.*'wrench'", takes[0], session(tmp_path / "f.mcap", feeds=()))
    refuse("a.mcap: there are no taps.*force=true or aligned=false", takes[0], force=False)
    assert LeRobot(fps=FPS, aligned=False).write(takes, tmp_path / "bare")
    with pytest.raises(InputError, match="lerobot"):
        LeRobot(force=True).read(tmp_path / "bare", tmp_path / "again.mcap")
