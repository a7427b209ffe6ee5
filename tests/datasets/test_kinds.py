"""Every window is of one kind, and the counts add up."""

import numpy as np

from monochord.datasets.kinds import KINDS, counts_of, kinds, table_of
from monochord.datasets.split import split_dataset
from monochord.datasets.store import Dataset


def test_kinds_are_those_of_the_touches_that_were_played(several: Dataset) -> None:
    masks = kinds(several)
    # 12 s of 0.1 s each: half untouched; every touch is a second, and every other one slides for half of it
    assert counts_of(masks) == {"static": 450, "slip": 150, "no contact": 600, "transition": 0, "masked": 0}
    assert several.manifest.counts == {**counts_of(masks), "clipped": 0}


def test_the_table_adds_up_to_the_split(several: Dataset) -> None:
    split = split_dataset(several, by="object", held_out=["wood"])
    table = table_of(several, split)
    assert list(table["test"]) == ["wood"]
    assert set(table["train"]) == {"metal", "plastic"}
    for name, rows in split.parts.items():
        assert sum(sum(counts.values()) for counts in table[name].values()) == len(rows)
        assert all(tuple(counts) == KINDS for counts in table[name].values())


def test_an_empty_part_has_an_empty_table(several: Dataset) -> None:
    split = split_dataset(several, fractions=(0.8, 0.0, 0.2))
    assert table_of(several, split)["validation"] == {}
    assert counts_of(np.zeros(0, np.int8)) == dict.fromkeys(KINDS, 0)
