"""Splits keep apart what they say, come near their shares, and can be made again."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.datasets.audit import audit
from monochord.datasets.kinds import table_of
from monochord.datasets.split import PARTS, Split, refuse_too_few, split_dataset
from monochord.datasets.store import Dataset


def held(dataset: Dataset, split: Split, what: str) -> dict[str, set[object]]:
    """Return the objects, or the builds, of the sessions in each part."""
    sessions = {name: dataset.session[rows] for name, rows in split.parts.items()}
    return {name: {getattr(dataset.manifest.parts[n], what) for n in each} for name, each in sessions.items()}


@pytest.mark.parametrize("by", ["session", "object", "time", "day", "build"])
def test_a_split_is_clean_complete_and_determined_by_its_seed(several: Dataset, by: str) -> None:
    seed = 1
    split = split_dataset(several, by=by, seed=seed)
    again = split_dataset(several, by=by, seed=seed)
    assert all((split.parts[name] == again.parts[name]).all() for name in PARTS)
    rows = np.concatenate(list(split.parts.values()))
    assert np.unique(rows).size == rows.size == len(several) - split.left_out
    assert audit(several, split, duplicates=False).clean


def test_another_seed_gives_another_split(several: Dataset) -> None:
    tests = {tuple(split_dataset(several, by="session", seed=seed).test.tolist()) for seed in range(8)}
    assert len(tests) > 3


def test_shares_are_as_close_as_whole_sessions_allow(several: Dataset) -> None:
    split = split_dataset(several, by="session", fractions=(0.6, 0.2, 0.2))
    assert [len(split.parts[name]) / len(several) for name in PARTS] == pytest.approx(
        [0.6, 0.2, 0.2], abs=0.01
    )


def test_sessions_of_every_object_are_tested_where_there_are_enough(several: Dataset) -> None:
    split = split_dataset(several, by="session", fractions=(0.5, 0.0, 0.5))
    assert held(several, split, "body")["test"] == {"plastic", "wood", "metal"}
    assert not split.validation.size


def test_every_part_gets_a_session_however_short_the_others_are(make: Callable[..., Dataset]) -> None:
    dataset = make({"a": {}, "b": {}, "c": {"samples": np.ones((2, 2000), np.float32)}})
    for seed in range(6):
        split = split_dataset(dataset, fractions=(0.9, 0.05, 0.05), seed=seed)
        assert all(split.parts[name].size for name in PARTS)


def test_held_out_objects_are_in_the_test_alone(several: Dataset) -> None:
    split = split_dataset(several, by="object", held_out=["wood", "metal"])
    bodies = held(several, split, "body")
    assert bodies == {"train": {"plastic"}, "validation": {"plastic"}, "test": {"wood", "metal"}}
    assert split.groups["test"] == ("metal", "wood")


def test_sessions_are_held_out_by_patterns_of_their_names(several: Dataset) -> None:
    split = split_dataset(several, held_out=["wood", "take[01]"], seed=5)
    again = split_dataset(several, held_out=["wood", "take[01]"], seed=5)
    assert all((split.parts[name] == again.parts[name]).all() for name in PARTS)
    apart = {part.name for part in several.manifest.parts if part.body == "wood"} | {"take0", "take1"}
    assert set(split.groups["test"]) > apart
    assert not apart & {*split.groups["train"], *split.groups["validation"]}
    assert audit(several, split, duplicates=False).clean
    claimed = replace(split, held_out=(*split.held_out, split.groups["train"][0] + "*"))
    (leak,) = audit(several, claimed, duplicates=False).leaks
    assert (leak.kind, leak.parts, leak.where) == (
        "held out",
        ("train",),
        f"session {split.groups['train'][0]}",
    )


def test_folders_before_names_do_not_hide_what_is_held_out(make: Callable[..., Dataset]) -> None:
    sessions = {"take_0": {}, "take_1": {}, "take_2": {}, "music_0": {"folder": "one"}}
    dataset = make(sessions)
    parts = tuple(replace(part, name=f"monday/{part.name}") for part in dataset.manifest.parts)
    moved = replace(dataset, manifest=replace(dataset.manifest, parts=parts))
    assert "monday/music_0" in split_dataset(moved, held_out=["music*"]).groups["test"]


def test_a_split_by_time_keeps_its_guard_and_tears_no_touch(several: Dataset) -> None:
    split = split_dataset(several, by="time", guard=0.5)
    size = several.manifest.window
    part_of = np.full(len(several), -1)
    for number, name in enumerate(PARTS):
        part_of[split.parts[name]] = number
    for part in several.manifest.parts:
        rows = np.arange(part.first, part.first + part.windows)
        rows = rows[part_of[rows] >= 0]
        changes = np.flatnonzero(np.diff(part_of[rows]))
        assert len(changes) == 2
        gaps = several.start[rows[changes + 1]] - several.start[rows[changes]] - size
        assert (gaps >= 0.5 * several.manifest.sample_rate).all()
    assert not audit(several, split, duplicates=False).notes


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"by": "sesion"}, "sesion.*'session'"),
        ({"by": "shuffle"}, "shuffle"),  # windows of one touch lie beside each other
        ({"fractions": (0.5, 0.5, 0.5)}, "0.5"),
        ({"fractions": (0.0, 0.5, 0.5)}, "0.5"),
        ({"fractions": (1.2, -0.1, -0.1)}, "1.2"),
        ({"by": "object", "held_out": ["wod"]}, "'wod'.*'wood'"),
        ({"by": "object", "held_out": ["wood", "metal", "plastic"]}, "train"),
        ({"by": "day", "held_out": ["wood"]}, "day"),
        ({"by": "object", "held_out": ["take*"]}, r"take\*"),
        ({"held_out": ["tak"]}, r"'tak'.*'take\*'"),
        ({"held_out": ["teke*"]}, r"'teke\*'.*'take\*'"),
        ({"held_out": ["music_???"]}, r"take\*$"),
        ({"by": "time", "guard": 0.01}, "0.01.*0.2 s"),
    ],
)
def test_what_cannot_be_split_is_refused(several: Dataset, options: dict[str, object], line: str) -> None:
    with pytest.raises(InputError, match=line):
        split_dataset(several, **options)  # pyright: ignore[reportArgumentType]


def test_sessions_without_a_day_are_not_split_by_day(make: Callable[..., Dataset]) -> None:
    dataset = make({"a": {"day": 1}, "b": {}, "c": {"day": 2}})
    with pytest.raises(InputError, match="session b"):
        split_dataset(dataset, by="day")


def test_held_out_builds_are_in_the_test_alone(make: Callable[..., Dataset]) -> None:
    dataset = make({f"take_{build}_{i}": {"build": build} for build in range(4) for i in range(2)})
    split = split_dataset(dataset, by="build", held_out=["take_3_*"])
    builds = held(dataset, split, "build")
    assert builds["test"] == {3}
    assert builds["train"] | builds["validation"] == {0, 1, 2}
    assert not builds["train"] & builds["validation"]


def test_a_file_holds_the_whole_split(several: Dataset, tmp_path: Path) -> None:
    split = split_dataset(several, by="time", seed=3)
    split.write(tmp_path / "split.json")
    read = Split.read(tmp_path / "split.json")
    assert (read.by, read.seed, read.guard, read.left_out, read.dataset) == (
        "time", 3, split.guard, split.left_out, split.dataset,
    )  # fmt: skip
    assert all((read.parts[name] == split.parts[name]).all() for name in PARTS)
    assert (tmp_path / "split.json").stat().st_size < 20_000
    (tmp_path / "split.json").write_text("{}")
    for absent in ("split.json", "nothing.json"):
        with pytest.raises(InputError, match=absent):
            Split.read(tmp_path / absent)


def test_a_split_of_ones_own_needs_its_way_and_its_rows(several: Dataset, tmp_path: Path) -> None:
    (file := tmp_path / "mine.json").write_text(
        '{"by": "session", "parts": {"train": [[0, 240]], "test": [[240, 360]]}}'
    )
    split = Split.read(file)
    assert (len(split.train), len(split.validation), len(split.test)) == (240, 0, 120)
    assert audit(several, split, duplicates=False).clean
    file.write_text('{"by": "session", "parts": {"train": [[0, 240]], "val": [[200, 360]]}}')
    with pytest.raises(InputError, match=r"'val'.*train, validation, test"):
        Split.read(file)
    file.write_text('{"by": "window", "parts": {}}')
    with pytest.raises(InputError, match="window"):
        Split.read(file)


@pytest.mark.parametrize(
    ("by", "objects", "held_out"),
    [
        ("session", ["a", "b"], []),
        ("session", ["a", "b"], ["a"]),
        ("object", ["a", "a", "a"], []),
        ("object", ["a", "b"], ["b"]),
        ("object", ["a", "b", "c"], ["d"]),
        ("day", ["a", "b", "c"], []),
    ],
)
def test_too_few_sessions_are_refused_by_their_names_alone(
    by: str, objects: list[str], held_out: list[str]
) -> None:
    with pytest.raises(InputError):
        refuse_too_few(by, objects, [0] * len(objects), held_out)


def test_what_can_be_split_is_not_refused() -> None:
    refuse_too_few("session", ["a", "a", "b"], [0, 0, 0], ["take*"], ["x_0", "x_1", "take_2"])
    refuse_too_few("session", ["a", "a", "b"], [0, 0, 0], ["b"])
    refuse_too_few("object", ["a", "b", "b"], [0, 0, 0])
    refuse_too_few("day", ["a", "a", "a"], [0, 1, 2])
    refuse_too_few("time", ["a"], [None])
    refuse_too_few("build", ["a", "a", "a"], [0, 0, 0], builds=[0, 1, 2])


def test_every_window_is_of_one_kind_and_the_table_adds_up_to_the_split(several: Dataset) -> None:
    # 12 s of 0.1 s each: half untouched; every touch is a second, and every other one slides for half of it
    counts = {"static": 450, "slip": 150, "touched": 0, "no contact": 600, "transition": 0, "masked": 0}
    assert several.manifest.counts == {**counts, "clipped": 0}
    split = split_dataset(several, by="object", fractions=(0.8, 0.0, 0.2), held_out=["wood"])
    table = table_of(several, split)
    assert (list(table["test"]), table["validation"]) == (["wood"], {})
    assert set(table["train"]) == {"metal", "plastic"}
    for name, rows in split.parts.items():
        assert sum(sum(counts.values()) for counts in table[name].values()) == len(rows)
