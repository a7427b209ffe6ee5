"""A checkpoint is there whole, or refused; the folder of a run belongs to one run."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.perception.training.checkpoint import Checkpoint
from monochord.perception.training.run_folder import claim


def checkpoint(epoch: int = 3) -> Checkpoint:
    return Checkpoint(
        epoch=epoch,
        data="ab12",
        weights={"contact.0.weight": np.arange(4, dtype=np.float32)[None]},
        moments={"0/step": np.array(7.0, np.float32)},
        best={"contact.0.weight": np.ones((1, 4), np.float32)},
        score={"contact": 0.1 + 0.2},
        at={"contact": 2},
        history=[{"epoch": 1, "loss": 1.0 / 3.0}],
    )


def test_what_was_written_is_read_to_the_bit(tmp_path: Path) -> None:
    file = tmp_path / "checkpoint.safetensors"
    checkpoint().write(file)
    loaded = Checkpoint.read(file)
    assert loaded is not None
    assert (loaded.epoch, loaded.score, loaded.at, loaded.history) == (
        3,
        {"contact": 0.1 + 0.2},
        {"contact": 2},
        checkpoint().history,
    )
    for name in ("weights", "moments", "best"):
        for key, array in getattr(checkpoint(), name).items():
            np.testing.assert_array_equal(getattr(loaded, name)[key], array)
            assert getattr(loaded, name)[key].shape == array.shape


def test_where_there_is_none_training_begins(tmp_path: Path) -> None:
    assert Checkpoint.read(tmp_path / "checkpoint.safetensors") is None


def test_the_next_one_takes_its_place(tmp_path: Path) -> None:
    file = tmp_path / "checkpoint.safetensors"
    checkpoint(1).write(file)
    checkpoint(2).write(file)
    loaded = Checkpoint.read(file)
    assert loaded is not None
    assert loaded.epoch == 2
    assert [each.name for each in tmp_path.iterdir()] == [file.name]


@pytest.mark.parametrize("left", [0, 60, -1])
def test_half_of_one_is_refused(tmp_path: Path, left: int) -> None:
    file = tmp_path / "checkpoint.safetensors"
    checkpoint().write(file)
    file.write_bytes(file.read_bytes()[:left])
    with pytest.raises(InputError, match=file.name):
        Checkpoint.read(file)


def test_a_changed_bit_anywhere_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "checkpoint.safetensors"
    checkpoint().write(file)
    whole = file.read_bytes()
    for at in range(len(whole) - 36, len(whole)):  # the numbers
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        with pytest.raises(InputError, match=file.name):
            Checkpoint.read(file)


@pytest.mark.parametrize("kind", [np.float16, np.int64])
def test_other_numbers_are_refused(tmp_path: Path, kind: type[np.generic]) -> None:
    file = tmp_path / "checkpoint.safetensors"
    replace(checkpoint(), best={"contact.0.weight": np.ones((1, 4), kind)}).write(file)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match=file.name):
        Checkpoint.read(file)
    replace(checkpoint(), best={"contact.0.weight": np.full((1, 4), np.nan, np.float32)}).write(file)
    with pytest.raises(InputError, match=file.name):
        Checkpoint.read(file)


def test_a_folder_belongs_to_one_run_and_to_nothing_else(tmp_path: Path) -> None:
    claim(tmp_path / "a" / "run", {"seed": 0})
    claim(tmp_path / "a" / "run", {"seed": 0})
    (tmp_path / "thesis.tex").write_text("...")
    for folder in ("a/run", ".", "thesis.tex"):
        with pytest.raises(InputError):
            claim(tmp_path / folder, {"seed": 1})
    assert (tmp_path / "thesis.tex").read_text() == "..."
