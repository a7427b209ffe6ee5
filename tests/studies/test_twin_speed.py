"""The benchmark of the virtual sensor, kept short."""

import os
from typing import Any

import pytest
from studies.twin_speed import FDTD, Twin

from monochord.benchmarks.base import Row
from monochord.core.errors import InputError

PARTS = ("free", "ebows", "touch", "full")


@pytest.fixture(scope="module")
def rows() -> dict[str, Row]:
    return {row.name: row for row in Twin(seconds=0.4, stretch=0.02, sensors=3).run()}


def test_every_part_stands_beside_the_papers_scheme(rows: dict[str, Row]) -> None:
    paper = rows["paper's FDTD, time/audio"]
    assert paper.value > 0.0
    for name in PARTS:
        row = rows[f"{name}, time/audio"]
        assert row.value > 0.0
        assert row.baseline == FDTD
        assert row.baseline_value == pytest.approx(paper.value, rel=0.5)
    assert rows["free, time/audio"].value < 2.0 * rows["full, time/audio"].value  # the least against the most


def test_a_plausible_world_stands_beside_the_ideal_one(rows: dict[str, Row]) -> None:
    row = rows["full in the world plausible, time/audio"]
    assert row.baseline == "full, ideal"
    assert row.ratio is not None
    assert 0.8 < row.ratio < 2.5  # measured: 1.4 over longer stretches


def test_a_force_that_is_new_every_millisecond_is_timed_beside_its_aim(rows: dict[str, Row]) -> None:
    for world in ("ideal", "plausible"):
        short, long = (rows[f"led and advanced by {time} ms, {world}"] for time in (1, 10))
        assert 0.0 < short.value < long.value  # ms; ten times as much sound
        assert short.ratio is not None
        assert long.ratio is not None


def test_many_are_timed_on_one_core_and_on_all(rows: dict[str, Row]) -> None:
    cores = len(os.sched_getaffinity(0))
    many, share = rows["3 touched twins, wall/audio"], rows[f"share of {cores} cores used"]
    assert many.baseline == "on one core"
    assert many.ratio is not None
    assert share.value == pytest.approx(1.0 / many.ratio / cores)
    assert 0.0 < share.value < 1.5


@pytest.mark.parametrize(
    "options",
    [
        {"stretch": 0.0}, {"stretch": 1.0, "seconds": 0.5}, {"seconds": 1e4}, {"seconds": float("nan")},
        {"sensors": 1}, {"sensors": 5000}, {"sensor": "prototipe"},
    ],
)  # fmt: skip
def test_options_that_make_no_sense_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        list(Twin(**options).run())
