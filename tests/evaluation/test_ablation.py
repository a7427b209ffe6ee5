"""A grid trains and judges each variation by the same rules, once."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monochord.config import to_tree
from monochord.datasets.build import Options, build_dataset
from monochord.datasets.split import split_dataset
from monochord.datasets.store import Dataset, open_dataset
from monochord.errors import InputError
from monochord.evaluation.ablation import (
    DONE,
    WHOLE,
    AblationError,
    Grid,
    Variation,
    ablate,
    as_dealt,
    compared,
)
from monochord.evaluation.results import Results
from monochord.evaluation.scorecard import scorecard

Oracle = Callable[..., Results]


@pytest.fixture(name="several", scope="module")
def _several(learnable: Path, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Return the dataset of eight small sessions, split by session."""
    folder = tmp_path_factory.mktemp("several") / "dataset"
    shutil.copytree(learnable, folder)
    return open_dataset(folder)


def test_other_windows_are_dealt_as_the_first_were(several: Dataset, learnable: Path, tmp_path: Path) -> None:
    split = split_dataset(several)
    files = sorted(learnable.parent.glob("*.mcap"))
    other = build_dataset(files, tmp_path / "short", Options(window=0.05, hop=0.05))
    dealt = as_dealt(other, several, split)
    for name, rows in split.parts.items():
        mine = {several.manifest.parts[at].name for at in several.session[rows].tolist()}
        theirs = {other.manifest.parts[at].name for at in other.session[dealt.parts[name]].tolist()}
        assert mine == theirs
        assert len(dealt.parts[name]) >= 2 * len(rows)
    assert dealt.dataset != split.dataset


def test_fewer_sessions_train_and_the_test_stays(several: Dataset) -> None:
    split = split_dataset(several)
    half, same, other = (as_dealt(several, several, split, 0.5, seed) for seed in (0, 0, 1))
    assert 0 < len(half.train) < len(split.train)
    assert set(half.train.tolist()) < set(split.train.tolist())
    np.testing.assert_array_equal(half.train, same.train)
    assert half.groups["train"] != other.groups["train"]
    np.testing.assert_array_equal(half.test, split.test)
    assert half.left_out == len(split.train) - len(half.train)


def test_what_cannot_be_dealt_again_is_refused(several: Dataset, dataset: Dataset) -> None:
    with pytest.raises(InputError, match="a split by time"):
        as_dealt(several, several, split_dataset(several, by="time"))
    with pytest.raises(InputError, match="sessions without sung_"):
        as_dealt(dataset, several, split_dataset(several))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('dataset = "d"\n[variations.whole]\n', "variation 'whole'"),
        ('dataset = "d"\n[variations."../up"]\n', "variation '../up'"),
        ('dataset = "d"\n[variations.short]\nwindow = 0.05\n', "windows of its own"),
        ('dataset = "d"\n[variations.few]\nshare = 0.0\n', "share 0 of the training sessions"),
        ('dataset = "d"\nvariation = 3\n', "did you mean 'variations'"),
        ("title = 3", "title"),
    ],
)
def test_a_grid_that_cannot_be_is_told_in_a_line(tmp_path: Path, text: str, line: str) -> None:
    (tmp_path / "grid.toml").write_text(text)
    with pytest.raises(InputError) as told:
        Grid.read(tmp_path / "grid.toml")
    assert line in str(told.value)
    assert "\n" not in str(told.value)


def test_the_whole_comes_first(tmp_path: Path) -> None:
    (tmp_path / "grid.toml").write_text('dataset = "d"\n[variations.few]\nshare = 0.5\n')
    assert list(Grid.read(tmp_path / "grid.toml").variations) == [WHOLE, "few"]


def test_a_training_that_fails_is_told_with_its_own_line(several: Dataset, tmp_path: Path) -> None:
    grid = Grid(dataset=several.path, config="nowhere", variations={WHOLE: Variation()})
    with pytest.raises(AblationError, match="variation whole, train: configuration 'nowhere'"):
        ablate(grid, tmp_path)
    assert not (tmp_path / WHOLE / DONE).exists()


def test_what_is_done_is_not_done_again(oracle: Oracle, several: Dataset, tmp_path: Path) -> None:
    grid = Grid(dataset=several.path, variations={WHOLE: Variation()})
    scores = scorecard(oracle(), draws=0).tree()
    how = {"grid": to_tree(replace(grid, variations={})), "variation": to_tree(Variation())}
    (tmp_path / WHOLE).mkdir()
    (tmp_path / WHOLE / DONE).write_text(json.dumps({"how": how, "scores": scores}))
    (row,) = compared(ablate(grid, tmp_path))
    assert (row["variation"], row["position_mae"], row["slip_area"]) == (WHOLE, 0.0, 1.0)
    with pytest.raises(InputError, match="a variation of another grid"):
        ablate(replace(grid, part="test"), tmp_path)
