"""A dataset on disk is read a window at a time, as it was written."""

import errno
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from tests.datasets.conftest import Make, made

from monochord.core.errors import InputError
from monochord.core.types import Block
from monochord.core.windows import windows
from monochord.datasets import store
from monochord.datasets.manifest import FILE, Manifest, file_checksum
from monochord.datasets.store import Dataset, open_dataset, write_array
from monochord.sessions import read_session


@pytest.fixture(name="dataset", scope="module")
def _dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return made(tmp_path_factory.mktemp("store"), {"one": {}, "two": {}}, hop=0.03)


def test_windows_are_those_that_live_inference_sees(dataset: Dataset) -> None:
    samples = read_session(dataset.path.parent / "sessions" / "one.mcap").audio.samples
    blocks = [Block(samples=samples[:, at : at + 1000], start=at) for at in range(0, samples.shape[1], 1000)]
    size, hop = dataset.manifest.window, dataset.manifest.hop
    live = list(windows(blocks, size=size, hop=hop, sample_rate=dataset.manifest.sample_rate))
    rows = np.flatnonzero(dataset.session == 0)
    assert [each.start for each in live] == dataset.start[rows].tolist()
    assert all(
        (each.samples == dataset.window(row)).all() for each, row in zip(live, rows.tolist(), strict=True)
    )


def test_a_batch_is_a_copy_in_the_given_order(dataset: Dataset) -> None:
    rows = np.array([len(dataset) - 1, 0, 7, 0])
    batch = dataset.batch(rows)
    assert batch.shape == (4, 2, dataset.manifest.window)
    assert all((batch[at] == dataset.window(row)).all() for at, row in enumerate(rows.tolist()))
    batch[:] = 0.0
    assert dataset.window(0).any()


def test_what_is_mapped_cannot_be_written(dataset: Dataset) -> None:
    with pytest.raises(ValueError, match="read-only"):
        dataset.window(0)[0, 0] = 1.0


def test_a_dataset_goes_to_another_process_as_its_path(dataset: Dataset) -> None:
    dataset.window(0)
    sent = pickle.dumps(dataset)
    assert len(sent) < 1000
    assert (pickle.loads(sent).window(3) == dataset.window(3)).all()  # noqa: S301


def test_more_sessions_than_may_be_open_at_once(pair: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MAX_OPEN_FILES", 1)
    dataset = open_dataset(pair.path)
    last, window = len(dataset) - 1, dataset.window(0)
    before = window.copy()
    for row in (last, 0, last):
        assert dataset.window(row).any()
    assert (window == before).all()
    del window
    assert Path("/proc/self/maps").read_text(encoding="utf-8").count(str(pair.path / "audio")) == 1


def test_labels_are_nan_where_they_are_not_valid(dataset: Dataset) -> None:
    for name in dataset.manifest.columns:
        assert (np.isfinite(dataset.label(name)) == dataset.valid[name]).all()
    with pytest.raises(InputError, match=r"'positon'.*'position'"):
        dataset.label("positon")


def test_a_dataset_that_lacks_something_is_refused(own: Dataset) -> None:
    for gone in ("labels/force.npy", "windows/start.npy", "manifest.json"):
        (own.path / gone).unlink()
        with pytest.raises(InputError, match=gone):
            open_dataset(own.path)


def test_arrays_are_written_as_numpy_writes_them(tmp_path: Path) -> None:
    for values in (np.zeros((2, 7), np.float32), np.arange(5.0), np.zeros(0), np.array([True, False])):
        write_array(tmp_path / "ours.npy", values)
        np.save(tmp_path / "theirs.npy", values)
        assert (tmp_path / "ours.npy").read_bytes() == (tmp_path / "theirs.npy").read_bytes()


def test_a_full_disk_is_reported_as_such(tmp_path: Path) -> None:
    (tmp_path / "full.npy").symlink_to("/dev/full")
    with pytest.raises(OSError, match=r"full\.npy") as error:
        write_array(tmp_path / "full.npy", np.zeros(100000))
    assert error.value.errno == errno.ENOSPC


def test_it_tells_its_rules_its_sessions_and_no_folder_of_this_machine(several: Dataset) -> None:
    text = (several.path / FILE).read_text()
    manifest = json.loads(text)
    assert (manifest["rules"]["touched"], manifest["rules"]["untouched"]) == (0.9, 0.1)
    assert manifest["versions"]["monochord"]
    assert {part["labels"] for part in manifest["parts"]} == {"recorded"}
    assert str(several.path.parent) not in text
    for part in several.manifest.parts:
        assert part.checksum == file_checksum(several.path.parent / "sessions" / part.source)
    assert len({part.audio_checksum for part in several.manifest.parts}) == 10


def test_it_tells_whether_there_was_music_where_a_session_does(make: Make) -> None:
    sessions = {"a": {"more": {"music": "synthetic"}}, "b": {"more": {"music": ""}}, "c": {}}
    dataset = make(sessions)
    assert [part.music for part in dataset.manifest.parts] == ["synthetic", "", None]
    assert Manifest.read(dataset.path) == dataset.manifest
