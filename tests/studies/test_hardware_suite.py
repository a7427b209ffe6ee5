"""The hardware suite changes one thing at a time, and nothing of the touches."""

import json
from dataclasses import fields
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from studies.hardware_suite import CONDITIONS, Condition, chosen_conditions, hardware_suite, plan_of, render

from monochord.lab.assignment import Assignment, assignments
from monochord.lab.schedule import Schedule, schedule
from monochord.physics.twin.trajectory import Trajectory

CONDITION = "tuning +4 %"
CHANGED = {
    "clean": set[str](),
    "distortion": {"pickups"},
    "SNR": {"pickups"},
    "+20": {"drift"},
    "-20": {"drift"},
    "drive": {"drivers"},
    "spring": {"mount"},
    "linear": {"law"},
    "yielding": {"ends"},
    "motors": {"motors"},
    "tuning": {"drift"},
    "driver": {"drivers"},
    "microphone": {"pickups"},
    "microphones": {"pickups"},
    "gauge": {"string"},
    "foam": {"material"},
    "two": {"second"},
}
"""What differs from the clean condition, by the first word of a condition's name."""


def depths(motion: Trajectory) -> np.ndarray:
    """The tool's place where each move ends; taps are of a force, so of another depth at another pitch."""
    ends = np.array([phase.stop for phase in motion.phases if phase.kind != "tap"])
    return motion.path(ends)


def sessions(condition: Condition) -> list[Assignment]:
    return assignments(plan_of(condition, "prototype"))


@cache
def clean() -> list[tuple[Assignment, Schedule]]:
    return [(one, schedule(one)) for one in sessions(CONDITIONS[0])]


def kind(condition: Condition) -> str:
    return condition.name.split()[0]


FIRST = {kind(condition): condition for condition in reversed(CONDITIONS)}
"""The first condition of each kind; those that differ in a number alone are slow tests."""


@pytest.mark.parametrize(
    "condition",
    [
        pytest.param(each, id=each.name, marks=[pytest.mark.slow] * (each is not FIRST[kind(each)]))
        for each in CONDITIONS
    ],
)
def test_one_thing_differs_and_the_touches_are_the_same(condition: Condition) -> None:
    own = sessions(condition)
    if condition.builds:
        for protocol in ("hold", "slide"):
            builds = [one.build for one in own if one.group.protocol == protocol]
            assert len(set(builds)) == condition.builds
        cells, others = (sorted(map(tuple, np.concatenate([one.cells() for one in each]).tolist()))
                         for each in (own, [one for one, _ in clean()]))  # fmt: skip
        assert cells == others
        return
    differs: set[str] = set()
    for one, (other, scheduled) in zip(own, clean(), strict=True):
        motion, still = schedule(one).motion, scheduled.motion
        np.testing.assert_allclose(depths(motion), depths(still), atol=1e-9)
        pairs = [(one.sensor(), other.sensor()), (one.touch(still.keys), other.touch(still.keys))]
        for first, second in [*pairs, (one.group, other.group)]:
            differs |= {
                each.name for each in fields(first) if getattr(first, each.name) != getattr(second, each.name)
            }
    assert differs == CHANGED[kind(condition)]


@pytest.mark.slow
def test_a_suite_is_rendered_once(tmp_path: Path) -> None:
    chosen = chosen_conditions(["clean"])
    (folder,) = render(chosen, "prototype", tmp_path, quick=True).values()
    files = sorted(folder.glob("*.mcap"))
    assert [file.stem for file in files] == ["held_plastic_000", "sliding_plastic_000"]
    stamps = [file.stat().st_mtime_ns for file in files]
    render(chosen, "prototype", tmp_path, quick=True)
    assert [file.stat().st_mtime_ns for file in files] == stamps


@pytest.mark.slow
def test_a_model_follows_another_pitch_as_if_it_were_tuned(tmp_path: Path) -> None:
    out = tmp_path / "out"
    line = ["demo", "--quick", "--only", CONDITION, "--cache", str(tmp_path / "cache"), "--out", str(out)]
    CliRunner().invoke(hardware_suite, line, catch_exceptions=False)
    rows = json.loads((out / "hardware.json").read_text())
    conditions = ("clean", CONDITION, f"{CONDITION}, tuned")
    assert [(row["condition"], row["model"]) for row in rows] == [
        (condition, model) for condition in conditions for model in ("demo", "closed_form")
    ]
    usual, detuned, tuned = (row for row in rows if row["model"] == "demo")
    assert usual["answered"] > 0.95
    assert usual["position_mae_mm"] < 1.0
    for row in (detuned, tuned):
        assert row["answered"] > 0.8
        assert row["position_mae_mm"] < 1.0
    assert usual["n"] == detuned["n"] == tuned["n"]
    assert (out / "hardware.svg").stat().st_size > 0
