"""From settings to examples and scaling."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.datasets.store import open_dataset
from monochord.perception.features.base import SupportsCompliance
from monochord.perception.training.prepare import (
    Material,
    examples_of,
    material,
    noises_of,
    quietest,
    read_split,
    scaled_heads,
    scaling,
    stream_of,
    with_objects,
)
from monochord.perception.training.settings import Settings

pytest.importorskip("torch")
pytestmark = pytest.mark.usefixtures("made_up_features")


def made(lesson: dict[str, Any], **more: Any) -> tuple[Settings, Material, np.ndarray]:
    settings = Settings.read({**lesson, **more})
    dataset = open_dataset(settings.dataset)
    split = read_split(settings, dataset)
    return settings, material(settings, dataset, split), split.train


def test_what_it_comes_from_is_told(lesson: dict[str, Any]) -> None:
    _, source, _ = made(lesson)
    told = source.definition
    assert told.simulated
    assert len(told.sessions) == 6  # those of the test are not looked at
    assert all(len(checksum) == 64 for checksum in told.sessions.values())
    assert (told.sample_rate, told.window, len(told.feature.columns)) == (16000, 1600, 50)


def test_columns_are_scaled_by_training_windows(lesson: dict[str, Any]) -> None:
    settings, source, part = made(lesson, noise={"copies": 1})
    seen = examples_of(source, part, "train", noises_of(settings, 16000))
    found = scaling(seen)
    assert seen.base.shape[0] == 2
    rows = (seen.base.reshape(-1, 50) - found["scaler.mean"]) / found["scaler.scale"]
    np.testing.assert_allclose(rows.mean(axis=0), 0.0, atol=1e-3)
    np.testing.assert_allclose(rows.std(axis=0), 1.0, atol=1e-3)
    assert (found["context.mean"][-1], found["context.scale"][-1]) == (0.0, 1.0)
    assert {name: array.shape for name, array in found.items()}.items() <= source.definition.shapes().items()


def test_a_column_that_never_varies_is_left_alone(lesson: dict[str, Any]) -> None:
    _, source, part = made(lesson, context={"on": False})
    seen = examples_of(source, part, "train")
    flat = dataclasses.replace(seen, base=np.full_like(seen.base, 3.0))
    assert (scaling(flat)["scaler.scale"] == 1.0).all()
    assert seen.context.shape[-1] == 0


def test_amounts_are_learned_in_deviations_of_their_labels(lesson: dict[str, Any]) -> None:
    _, source, part = made(lesson)
    seen = examples_of(source, part, "train")
    heads = scaled_heads(source.definition, seen).heads
    labels = seen.labels["position"][seen.masks["position"]]
    assert heads["position"].offset == pytest.approx(labels.mean())
    assert heads["position"].scale == pytest.approx(labels.std())
    assert (heads["slip"].offset, heads["slip"].scale) == (0.0, 1.0)


def test_the_reference_in_noise_is_noisy(lesson: dict[str, Any]) -> None:
    settings, source, part = made(lesson, noise={"copies": 1, "ratios": [5.0, 5.0]})
    seen = examples_of(source, part, "train", noises_of(settings, 16000))
    known = seen.context[0, :, -1] > 0.0
    assert (seen.context[1, known, :-1] != seen.context[0, known, :-1]).mean() > 0.7


def test_what_is_far_below_all_that_was_trained_on_is_silence(lesson: dict[str, Any]) -> None:
    _, source, part = made(lesson)
    levels = np.sqrt(np.mean(source.dataset.batch(part).astype(float) ** 2, axis=(1, 2)))
    assert quietest(source.dataset, part) == pytest.approx(0.5 * levels.min(), rel=0.02)


def test_a_stream_is_all_that_can_be_heard_of_a_part(lesson: dict[str, Any]) -> None:
    _, source, part = made(lesson)
    torn = np.zeros(len(source.dataset), bool)
    torn[part[3]] = True
    heard = stream_of(dataclasses.replace(source.dataset, has_gap=torn), part[::-1])
    assert heard.tolist() == [row for row in part.tolist() if row != part[3]]


def test_a_split_of_another_dataset_is_refused(lesson: dict[str, Any], tmp_path: Path) -> None:
    settings = Settings.read(lesson)
    dataset = open_dataset(settings.dataset)
    split = read_split(settings, dataset)
    file = tmp_path / "split.json"
    dataclasses.replace(split, dataset="0" * 64).write(file)
    with pytest.raises(InputError, match=r"split .* of another dataset"):
        read_split(dataclasses.replace(settings, split=file), dataset)
    dataclasses.replace(split, dataset="", parts={**split.parts, "test": np.array([10**6])}).write(file)
    with pytest.raises(InputError, match=r"split .* of more windows"):
        read_split(dataclasses.replace(settings, split=file), dataset)


def test_a_part_may_not_be_empty(lesson: dict[str, Any]) -> None:
    _, source, part = made(lesson)
    with pytest.raises(InputError, match="leaves nothing to validation"):
        examples_of(source, part[:0], "validation")


def test_copies_of_other_compliance_follow_the_recorded_windows(
    lesson: dict[str, Any],
) -> None:
    settings, source, part = made(lesson, noise={"copies": 1}, objects={"copies": 3, "give": [0.5, 2.0]})
    calls: list[tuple[np.ndarray, np.ndarray]] = []

    class Augmented(SupportsCompliance):
        def with_compliance(self, rows: np.ndarray, force: np.ndarray, share: np.ndarray) -> np.ndarray:
            calls.append((force, share))
            return rows + 1.0

    examples = examples_of(source, part, "train", noises_of(settings, 16000))
    source = dataclasses.replace(source, feature=dataclasses.replace(source.feature, extractor=Augmented()))
    augmented = with_objects(source, examples, settings)
    assert (examples.base.shape[0], augmented.base.shape[0], augmented.context.shape[0]) == (2, 8, 8)
    np.testing.assert_array_equal(augmented.base[2:4], examples.base + 1.0)
    np.testing.assert_array_equal(augmented.context[6:8], examples.context)
    force, share = calls[0]
    valid = examples.masks["force"]
    np.testing.assert_allclose(force[valid], examples.labels["force"][valid])
    assert (force[~valid] == 0.0).all()
    assert 0.5 <= share.min() < 0.6
    assert 1.8 < share.max() <= 2.0
    assert len({share.tobytes() for _, share in calls}) == 6


def test_a_feature_without_compliance_augmentation_is_refused(lesson: dict[str, Any]) -> None:
    settings, source, part = made(lesson, objects={"copies": 1})
    examples = examples_of(source, part, "train")
    with pytest.raises(InputError, match=r"'bands' .* set objects.copies = 0"):
        with_objects(source, examples, settings)
    assert with_objects(source, examples, Settings.read(lesson)) is examples
