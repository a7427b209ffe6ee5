"""A dataset on disk is read a window at a time, as it was written."""

import errno
import pickle
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.datasets.conftest import Make

from monochord.core.errors import InputError
from monochord.core.types import Block
from monochord.core.windows import windows
from monochord.datasets import store
from monochord.datasets.store import Dataset, open_dataset, window_starts, write_array
from monochord.sessions import read_session


@pytest.fixture(name="dataset")
def _dataset(make: Make) -> Dataset:
    return make({"one": {}, "two": {}}, hop=0.03)


def test_windows_are_those_that_live_inference_sees(dataset: Dataset, tmp_path: Path) -> None:
    samples = read_session(tmp_path / "sessions" / "one.mcap").audio.samples
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


def test_more_sessions_than_may_be_open_at_once(dataset: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MAX_OPEN_FILES", 1)
    last = len(dataset) - 1
    window = dataset.window(0)
    before = window.copy()
    for row in (last, 0, last):
        assert dataset.window(row).any()
    assert (window == before).all()
    assert len(dataset._tracks) == 1


def test_labels_are_nan_where_they_are_not_valid(dataset: Dataset) -> None:
    for name in dataset.manifest.columns:
        assert (np.isfinite(dataset.label(name)) == dataset.valid[name]).all()
    with pytest.raises(InputError, match="did you mean 'position'"):
        dataset.label("positon")


@pytest.mark.parametrize("gone", ["manifest.json", "windows/start.npy", "labels/force.npy"])
def test_a_dataset_that_lacks_something_is_refused(dataset: Dataset, tmp_path: Path, gone: str) -> None:
    part = tmp_path / "part"
    shutil.copytree(dataset.path, part)
    (part / gone).unlink()
    with pytest.raises(InputError, match="dataset"):
        open_dataset(part)
    (part / gone).write_bytes(b"nonsense")
    with pytest.raises(InputError, match="damaged"):
        open_dataset(part)


def test_columns_of_another_length_are_refused(dataset: Dataset) -> None:
    np.save(dataset.path / "labels" / "force.npy", np.zeros(3))
    with pytest.raises(InputError, match=r"force\.npy \(damaged: 152 bytes\)"):
        open_dataset(dataset.path)


def test_windows_lie_wholly_in_the_sound() -> None:
    assert window_starts(100, 10, 10).tolist() == list(range(0, 91, 10))
    assert window_starts(99, 10, 10)[-1] == 80
    assert window_starts(9, 10, 10).size == 0


@pytest.mark.parametrize(
    "values", [np.zeros((2, 7), np.float32), np.arange(5.0), np.zeros(0), np.array([True, False])]
)
def test_arrays_are_written_as_numpy_writes_them(values: NDArray[Any], tmp_path: Path) -> None:
    write_array(tmp_path / "ours.npy", values)
    np.save(tmp_path / "theirs.npy", values)
    assert (tmp_path / "ours.npy").read_bytes() == (tmp_path / "theirs.npy").read_bytes()


def test_a_full_disk_is_reported_as_such(tmp_path: Path) -> None:
    (tmp_path / "full.npy").symlink_to("/dev/full")
    with pytest.raises(OSError, match=r"full\.npy") as error:
        write_array(tmp_path / "full.npy", np.zeros(100000))
    assert error.value.errno == errno.ENOSPC
