"""Labels, masks and references: what counts for whom."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.datasets.store import Dataset, open_dataset
from monochord.perception.heads import HEADS
from monochord.perception.model.definition import FeatureRecord, Reference
from monochord.perception.training.examples import assembled, believed, chosen, folded, masks_of

TASKS = {name: HEADS.build(name).task() for name in HEADS.names()}
RULE = Reference(feature=FeatureRecord(name="row", options={}, columns=("row",)))


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


def test_windows_with_lost_samples_count_for_nobody(dataset: Dataset) -> None:
    torn = dataclasses.replace(dataset, has_gap=np.ones(len(dataset), bool))
    assert not any(mask.any() for mask in masks_of(torn, TASKS).values())


def test_a_label_that_is_no_number_where_it_is_valid_is_refused(dataset: Dataset) -> None:
    values = np.array(dataset.label("force"))
    values[np.flatnonzero(dataset.valid["force"])[:3]] = np.nan
    with pytest.raises(
        InputError, match="label 'force' that is no number in 3 windows where it is marked valid"
    ):
        masks_of(with_label(dataset, "force", values), TASKS)


def test_a_label_that_is_missing_is_refused(dataset: Dataset) -> None:
    fewer = {name: values for name, values in dataset.labels.items() if name != "slip"}
    with pytest.raises(InputError, match=r"label 'slip': allowed is contact, "):
        masks_of(dataclasses.replace(dataset, labels=fewer), TASKS)


def test_an_empty_part_is_refused(dataset: Dataset) -> None:
    with pytest.raises(InputError, match="a split that leaves nothing to train"):
        chosen(dataset, np.zeros(0, np.int64), TASKS, "train")


def test_a_part_where_nothing_slides_is_refused(dataset: Dataset) -> None:
    still = np.where(dataset.valid["slip"], 0.0, np.nan)
    line = "part 'train' without windows of yes and of no for the head 'slip'"
    with pytest.raises(InputError, match=line):
        chosen(with_label(dataset, "slip", still), np.arange(200), TASKS, "train")


def test_what_is_not_known_is_believed_touched(dataset: Dataset) -> None:
    contact = dataset.label("contact")
    found = believed(dataset, np.arange(len(dataset)))
    assert (found[np.isnan(contact)] == 1.0).all()
    assert (found[contact == 0.0] == 0.0).all()


def test_the_reference_is_of_untouched_windows_before_and_of_the_same_session(dataset: Dataset) -> None:
    rows = np.arange(len(dataset))
    contact = believed(dataset, rows)
    kept = {row: np.array([row], np.float32) for row in rows[contact == 0.0].tolist()}
    found = folded(dataset, rows, contact, RULE, kept)
    known = found[:, 1] > 0.0
    assert 0.9 < known.mean() < 1.0
    assert (found[known, 0] < rows[known]).all()
    first = np.array([part.first for part in dataset.manifest.parts])[dataset.session]
    assert (found[known, 0] >= first[known]).all()
    assert not known[first == rows].any()


def test_labels_that_do_not_count_are_zeros(dataset: Dataset) -> None:
    rows = np.arange(50)
    base = np.zeros((50, 3), np.float32)
    found = assembled(dataset, rows, TASKS, [base, base], [base[:, :0]] * 2)
    assert found.base.shape == (2, 50, 3)
    assert not found.labels["position"][~found.masks["position"]].any()
    assert found.labels["position"][found.masks["position"]].all()
