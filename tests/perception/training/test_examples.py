"""From settings and a dataset to examples: labels, masks and scaling."""

import dataclasses
import errno
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.datasets.store import Dataset, open_dataset
from monochord.perception.heads import HEADS
from monochord.perception.training.examples import (
    TrainingData,
    chosen,
    examples_of,
    masks_of,
    noises_of,
    quietest,
    read_split,
    scaling,
    targets_of,
    touches_of,
    training_data,
)
from monochord.perception.training.scratch import FileArray, empty
from monochord.perception.training.settings import TrainingSettings

pytest.importorskip("torch")
pytestmark = pytest.mark.usefixtures("made_up_features")
TASKS = {name: HEADS.build(name).task() for name in HEADS.names()}


@pytest.fixture
def dataset(learnable: Path) -> Dataset:
    return open_dataset(learnable)


def with_label(dataset: Dataset, name: str, values: np.ndarray) -> Dataset:
    return dataclasses.replace(dataset, labels={**dataset.labels, name: values})


def test_heads_that_need_a_touch_train_on_touches_alone(dataset: Dataset) -> None:
    masks, contact = masks_of(dataset, TASKS), dataset.label("contact")
    assert masks["contact"].sum() == np.isfinite(contact).sum()
    assert (contact[masks["position"]] == 1.0).all()
    assert 0.3 < masks["force"].mean() < 0.6


def test_windows_with_lost_samples_count_for_no_head(dataset: Dataset) -> None:
    torn = dataclasses.replace(dataset, has_gap=np.ones(len(dataset), bool))
    assert not any(mask.any() for mask in masks_of(torn, TASKS).values())


def test_labels_that_nothing_can_be_learned_from_are_refused(dataset: Dataset) -> None:
    values = np.array(dataset.label("force"))
    values[np.flatnonzero(dataset.valid["force"])[:3]] = np.nan
    with pytest.raises(InputError, match=r"'force'.* 3 windows"):
        masks_of(with_label(dataset, "force", values), TASKS)
    fewer = {name: values for name, values in dataset.labels.items() if name != "slip"}
    with pytest.raises(InputError, match=r"'slip'.*contact"):
        masks_of(dataclasses.replace(dataset, labels=fewer), TASKS)
    still = np.where(dataset.valid["slip"], 0.0, np.nan)
    with pytest.raises(InputError, match=r"'train'.*'slip'"):
        chosen(with_label(dataset, "slip", still), np.arange(200), TASKS, "train")


def made(lesson: dict[str, Any], **more: Any) -> tuple[TrainingSettings, TrainingData, np.ndarray]:
    settings = TrainingSettings.read({**lesson, **more})
    dataset = open_dataset(settings.dataset)
    split = read_split(settings, dataset)
    return settings, training_data(settings, dataset, split), split.train


def test_the_definition_has_the_training_sessions(lesson: dict[str, Any]) -> None:
    _, source, _ = made(lesson)
    definition = source.definition
    assert definition.simulated
    assert len(definition.sessions) == 6  # those of the test are not looked at
    assert all(len(checksum) == 64 for checksum in definition.sessions.values())
    assert (definition.sample_rate, definition.window, len(definition.feature.columns)) == (16000, 1600, 50)


def test_columns_are_scaled_by_training_windows(lesson: dict[str, Any]) -> None:
    settings, source, part = made(lesson, noise={"copies": 1})
    seen = examples_of(source, part, "train", noises_of(settings, 16000))
    arrays = scaling(seen)
    assert seen.base.shape[0] == 2
    rows = (seen.base.reshape(-1, 50) - arrays["scaler.mean"]) / arrays["scaler.scale"]
    np.testing.assert_allclose(rows.mean(axis=0), 0.0, atol=1e-3)
    np.testing.assert_allclose(rows.std(axis=0), 1.0, atol=1e-3)
    assert {name: array.shape for name, array in arrays.items()}.items() <= source.definition.shapes().items()


def test_examples_in_files_are_those_in_memory(
    lesson: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings, source, part = made(lesson, noise={"copies": 1})
    noises = noises_of(settings, 16000)
    memory = examples_of(source, part, "train", noises)
    monkeypatch.setattr("monochord.perception.training.examples.BLOCK", 7)
    filed = examples_of(dataclasses.replace(source, scratch=tmp_path), part, "train", noises)
    assert isinstance(filed.base, FileArray)
    assert not list(tmp_path.iterdir())
    for name in ("base", "rows", "touch"):
        np.testing.assert_array_equal(getattr(filed, name), getattr(memory, name))
    one, two = scaling(filed), scaling(memory)
    for name, array in one.items():
        np.testing.assert_allclose(array, two[name], rtol=1e-6, atol=1e-7)
    for name in source.tasks:
        own, other = (targets_of(source.definition, name, each) for each in (filed, memory))
        np.testing.assert_array_equal(own, other)


def test_a_full_disk_is_an_error_before_anything_is_put_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", full)
    with pytest.raises(OSError, match=f"No space left on device: '{tmp_path}'"):
        empty(tmp_path, (2, 3))


def test_far_below_all_training_windows_is_silence(lesson: dict[str, Any]) -> None:
    _, source, part = made(lesson)
    levels = np.sqrt(np.mean(source.dataset.batch(part).astype(float) ** 2, axis=(1, 2)))
    assert quietest(source.dataset, part) == pytest.approx(0.5 * levels.min(), rel=0.02)


def test_a_split_of_another_dataset_is_refused(lesson: dict[str, Any], tmp_path: Path) -> None:
    settings = TrainingSettings.read(lesson)
    dataset = open_dataset(settings.dataset)
    split = read_split(settings, dataset)
    file = tmp_path / "split.json"
    dataclasses.replace(split, dataset="0" * 64).write(file)
    with pytest.raises(InputError, match=file.name):
        read_split(dataclasses.replace(settings, split=file), dataset)
    dataclasses.replace(split, dataset="", parts={**split.parts, "test": np.array([10**6])}).write(file)
    with pytest.raises(InputError, match=file.name):
        read_split(dataclasses.replace(settings, split=file), dataset)


def test_a_touch_is_a_run_of_windows_in_one_session(dataset: Dataset) -> None:
    touch, contact = touches_of(dataset), dataset.label("contact")
    for number in np.unique(touch):
        rows = np.flatnonzero(touch == number)
        assert len(np.unique(dataset.session[rows])) == 1
        on = contact[rows] != 0.0
        assert np.count_nonzero(np.diff(on.astype(int)) == 1) <= 1
    always = touches_of(with_label(dataset, "contact", np.ones(len(dataset))))
    np.testing.assert_array_equal(always - always[0], dataset.session - dataset.session[0])
