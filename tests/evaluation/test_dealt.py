"""Other windows and fewer sessions are dealt out as the first were."""

from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.datasets.build import Options, build_dataset
from monochord.datasets.split import split_dataset
from monochord.datasets.store import Dataset, open_dataset
from monochord.evaluation.dealt import as_dealt


@pytest.fixture(name="several", scope="module")
def _several(learnable: Path) -> Dataset:
    """Return the dataset of eight small sessions."""
    return open_dataset(learnable)


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
