"""The audit catches each kind of leak that is planted, and nothing else."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.datasets.conftest import RATE, Make, sound

from monochord.core.errors import InputError
from monochord.datasets.audit import audit
from monochord.datasets.split import Split, split_dataset
from monochord.datasets.store import Dataset


def split_of(dataset: Dataset, train: Any, test: Any, *, by: Any = "session", guard: int = 0) -> Split:
    parts: Mapping[str, Any] = {"train": train, "validation": [], "test": test}
    return Split(by=by, parts={name: np.array(rows, np.int64) for name, rows in parts.items()}, guard=guard)


def rows_of(dataset: Dataset, *sessions: int) -> list[int]:
    return np.flatnonzero(np.isin(dataset.session, sessions)).tolist()


def leaks(dataset: Dataset, split: Split) -> dict[str, int]:
    return {leak.kind: leak.many for leak in audit(dataset, split).leaks}


def test_a_clean_split_passes(pair: Dataset) -> None:
    result = audit(pair, split_of(pair, rows_of(pair, 0), rows_of(pair, 1), by="object"))
    assert result.clean
    assert not result.notes
    result.refuse_leaks()


def test_a_window_in_two_parts(pair: Dataset) -> None:
    split = split_of(pair, rows_of(pair, 0), [*rows_of(pair, 1), 5, 7])
    assert leaks(pair, split)["shared window"] == 2
    with pytest.raises(InputError, match=r"shared window.*rows 5, 7"):
        audit(pair, split, duplicates=False).refuse_leaks()


def test_a_window_twice_in_one_part(pair: Dataset) -> None:
    assert leaks(pair, split_of(pair, [1, 1, 2, 2, 2], rows_of(pair, 1))) == {"repeated window": 3}


def test_windows_that_overlap(make: Make) -> None:
    dataset = make({"one": {}}, hop=0.04)  # windows up to two apart share samples
    for first, many in ((102, 0), (101, 1), (100, 2)):
        split = split_of(dataset, range(100), range(first, 200), by="time")
        assert leaks(dataset, split).get("shared samples", 0) == many


def test_a_guard_gap_that_is_too_small(pair: Dataset) -> None:
    size, hop = pair.manifest.window, pair.manifest.hop
    for first, leak in ((51, True), (52, False)):  # a gap of 0.1 and of 0.2 s, which a window and a hop are
        split = split_of(pair, range(50), range(first, 100), by="time", guard=0)
        assert (leaks(pair, split) == {"guard gap": 1}) == leak
    wide = split_of(pair, range(50), range(52, 100), by="time", guard=size + 2 * hop)
    assert leaks(pair, wide) == {"guard gap": 1}


def test_sessions_days_and_objects_that_are_in_two_parts(make: Make) -> None:
    takes = {"a": ("wood", 1), "b": ("wood", 2), "c": ("steel", 1), "d": ("steel", 2)}
    dataset = make({name: {"object": body, "day": day} for name, (body, day) in takes.items()})
    shared = split_of(dataset, range(60), range(100, 240), by="session")
    assert leaks(dataset, shared) == {"shared session": 20}
    assert leaks(dataset, replace(shared, by="time")) == {}
    days = split_of(dataset, rows_of(dataset, 0), rows_of(dataset, 2), by="day")
    assert leaks(dataset, days) == {"shared day": 120}
    builds = make({f"{name}_again": {"build": day} for name, (_, day) in takes.items()})
    assert leaks(builds, split_of(builds, rows_of(builds, 0), rows_of(builds, 2), by="build")) == {
        "shared build": 120
    }
    objects = split_of(dataset, rows_of(dataset, 0), rows_of(dataset, 1), by="object")
    assert leaks(dataset, objects) == {"shared object": 120}
    assert leaks(dataset, replace(objects, by="session")) == {}
    assert leaks(dataset, replace(objects, by="session", held_out=("wood",))) == {"held out": 120}


def test_validation_may_share_the_objects_of_the_training(make: Make) -> None:
    dataset = make({"a": {"object": "wood"}, "b": {"object": "wood"}, "c": {"object": "steel"}})
    parts = {"train": 0, "validation": 1, "test": 2}
    split = Split(by="object", parts={name: np.array(rows_of(dataset, n)) for name, n in parts.items()})
    assert audit(dataset, split).clean


def test_the_same_samples_under_another_name(make: Make) -> None:
    samples = {"one": sound(1), "two": sound(2), "copy": sound(1)}
    dataset = make({name: {"samples": each} for name, each in samples.items()})
    names = [part.name for part in dataset.manifest.parts]
    copy, one, two = (rows_of(dataset, names.index(name)) for name in ("copy", "one", "two"))
    assert leaks(dataset, split_of(dataset, one + two, copy)) == {"same checksum": 120}
    assert leaks(dataset, split_of(dataset, one + copy, two)) == {}


def changed(samples: np.ndarray, how: str) -> np.ndarray:
    match how:
        case "shifted":
            return samples[:, 4321:]
        case "late":
            return np.concatenate([np.zeros((2, 777), np.float32), samples], axis=1)
        case "swapped":
            return samples[::-1].copy()
        case _:  # through a WAV file of 16 bits
            return np.round(samples[:, 1234:] * 32767.0).astype(np.float32) / 32767.0


@pytest.mark.parametrize("how", ["shifted", "late", "swapped", "16 bits"])
def test_a_copy_that_was_changed(make: Make, how: str) -> None:
    original = sound(1)
    dataset = make({"a": {"samples": original}, "b": {"samples": changed(original, how)}, "c": {}})
    split = split_of(dataset, rows_of(dataset, 0), rows_of(dataset, 1, 2))
    (leak,) = audit(dataset, split).leaks
    assert leak.kind == "near duplicate"
    assert leak.where.startswith("a and b")
    assert leak.parts == ("train", "test")


@pytest.mark.parametrize("driven", [(5.0, 12.0), None])
def test_taps_that_sound_alike_are_no_copies(make: Make, driven: tuple[float, float] | None) -> None:
    alike = sound(2)
    alike[:, : 5 * RATE] = sound(1)[:, : 5 * RATE]
    one, two = ({"samples": samples, "driven": driven} for samples in (sound(1), alike))
    dataset = make({"one": one, "two": two})
    split = split_of(dataset, rows_of(dataset, 0), rows_of(dataset, 1))
    assert [*leaks(dataset, split)] == ([] if driven else ["near duplicate"])


def test_a_split_of_another_dataset(pair: Dataset, several: Dataset) -> None:
    assert leaks(pair, split_dataset(several)) == {"other dataset": 0} | {
        kind: many for kind, many in leaks(pair, split_dataset(several)).items() if many
    }
    assert leaks(pair, split_of(pair, range(10), [20, 10_000])) == {"other dataset": 1}


def test_a_torn_touch_is_noted(pair: Dataset) -> None:
    split = split_of(pair, range(13), range(16, 120), by="time")  # touched from 1 to 2 s
    result = audit(pair, split)
    assert result.clean
    assert len(result.notes) == 1
