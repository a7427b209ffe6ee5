"""Rows of a feature: computed once, cached, and computed again when anything differs."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.datasets.augment import Augmentation
from monochord.datasets.store import Dataset, open_dataset
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor
from monochord.perception.training.rows import AddedNoise, DatasetFeature


class Counting(Extractor):
    """Counts the windows that it is called on."""

    def __init__(self, inner: Extractor, factor: float = 1.0) -> None:
        self.inner, self.factor, self.count = inner, factor, 0

    @property
    def columns(self) -> tuple[str, ...]:
        return self.inner.columns

    def __call__(self, windows: Audio) -> Audio:
        self.count += len(windows)
        return (self.factor * self.inner(windows)).astype(np.float32)


@pytest.fixture
def dataset(learnable: Path) -> Dataset:
    return open_dataset(learnable)


def rows_of(
    dataset: Dataset, folder: Path, factor: float = 1.0, **options: Any
) -> tuple[DatasetFeature, Counting]:
    signal = Signal(sample_rate=dataset.manifest.sample_rate, channels=2)
    inner = FEATURES.build("bands", options).prepare(signal, dataset.manifest.window)
    extractor = Counting(inner, factor)
    about: Any = {"dataset": dataset, "signal": signal, "name": "bands", "options": options}
    return DatasetFeature(
        **about, extractor=extractor, folder=folder, prepare=lambda _string: extractor
    ), extractor


SOME = np.arange(40, 140)
NOISE = AddedNoise(augmentation=Augmentation(), copy=1, seed=1, sample_rate=16000)
PROBE = 3  # windows of the fingerprint

pytestmark = pytest.mark.usefixtures("made_up_features")


def test_they_are_what_the_feature_gives_window_by_window(dataset: Dataset, tmp_path: Path) -> None:
    rows, extractor = rows_of(dataset, tmp_path)
    result = rows.of(SOME)
    alone = np.concatenate([extractor(dataset.window(int(row))[None]) for row in SOME])
    np.testing.assert_array_equal(result, alone)
    assert result.dtype == np.float32


def test_the_second_time_they_come_from_disk(dataset: Dataset, tmp_path: Path) -> None:
    first = rows_of(dataset, tmp_path)[0].of(SOME, NOISE)
    again, extractor = rows_of(dataset, tmp_path)
    np.testing.assert_array_equal(again.of(SOME, NOISE), first)
    assert extractor.count == PROBE


def test_noise_is_of_its_copy_and_leaves_the_clean_rows_alone(dataset: Dataset, tmp_path: Path) -> None:
    rows, _ = rows_of(dataset, tmp_path)
    clean, one = rows.of(SOME), rows.of(SOME, NOISE)
    other = rows.of(SOME, replace(NOISE, copy=2))
    assert not np.array_equal(clean, one)
    assert not np.array_equal(one, other)
    samples = NOISE.added(dataset.batch(SOME[:1]), SOME[:1])
    np.testing.assert_array_equal(one[:1], rows.extractor(samples))


def test_a_feature_that_does_something_else_is_computed_anew(dataset: Dataset, tmp_path: Path) -> None:
    first = rows_of(dataset, tmp_path)[0].of(SOME)
    changed, extractor = rows_of(dataset, tmp_path, factor=2.0)
    np.testing.assert_array_equal(changed.of(SOME), 2.0 * first)
    assert extractor.count > PROBE


def test_a_damaged_file_is_computed_anew(dataset: Dataset, tmp_path: Path) -> None:
    rows, extractor = rows_of(dataset, tmp_path)
    first = rows.of(SOME)
    (file,) = tmp_path.rglob("*.npy")
    whole = file.read_bytes()
    changed = [whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :] for at in (80, len(whole) - 4000)]
    for damage in (b"", b"nonsense", whole[:-100], *changed, None):
        if damage is None:
            os.truncate(file, 1 << 40)  # which takes no memory
        else:
            file.write_bytes(damage)
        before = extractor.count
        np.testing.assert_array_equal(rows.of(SOME), first)
        assert extractor.count - before >= len(SOME)


def test_rows_that_are_not_finite_are_refused(dataset: Dataset, tmp_path: Path) -> None:
    rows, _ = rows_of(dataset, tmp_path, factor=float("nan"))
    with pytest.raises(InputError, match="'bands'"):
        rows.of(SOME)
    assert not list(tmp_path.rglob("*.npy"))
