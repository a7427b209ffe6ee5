"""The plans of studies: what judges a model is never what it learned from."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from studies.hardware_suite import FIRST_BUILD

from monochord.lab.assignment import assignments
from monochord.lab.plan import Group, Plan, ends
from monochord.lab.plans import load_plan, plan_names

FOLDER = Path(__file__).parents[2] / "studies" / "plans"
NAMES = sorted(file.stem for file in FOLDER.glob("*.toml"))
SEALED = [name for name in NAMES if name.startswith("sealed")]
NEWEST = "sealed_14"
"""The plan that judges next; those before it are as they were."""
SIZES = {f"sealed_{number}": (24, 13) for number in range(9, 15)}
"""Builds of one design and objects of a sealed plan; of those before, 20 and 10."""
OURS = plan_names()


@cache
def plan_of(name: str) -> Plan:
    return load_plan(name if name in OURS else str(FOLDER / f"{name}.toml"))


def every() -> list[str]:
    return [*OURS, *NAMES]


def _builds(group: Group) -> set[int]:
    """Seeds of the builds of a group."""
    own = range(0) if group.first_build is None else range(group.first_build, group.first_build + group.total)
    return {*group.builds, *own}


@pytest.mark.parametrize("name", NAMES)
def test_every_plan_loads_and_names_its_source(name: str) -> None:
    plan = plan_of(name)
    assert plan.title
    assert plan.source
    assert "simulated" in plan.notes


@pytest.mark.parametrize("plan", SEALED)
def test_a_sealed_plan_shares_no_build_day_or_made_up_object_with_any_other(plan: str) -> None:
    sealed = plan_of(plan)
    others = [group for name in every() if name != plan for group in plan_of(name).groups]
    builds = {build for group in sealed.groups for build in group.builds}
    days = {day for group in sealed.groups for day in group.days}
    materials = {group.material for group in sealed.groups}
    built, objects = SIZES.get(plan, (20, 10))
    assert len({build for group in sealed.groups if not group.design for build in group.builds}) == built
    assert not builds & {build for group in others for build in _builds(group)}
    assert not builds & {*range(FIRST_BUILD, FIRST_BUILD + 1000)}  # those of the hardware suite
    assert not days & {day for group in others for day in group.days}
    # The three have the same objects: no model learned from any.
    trained = [group for name in every() if name not in SEALED for group in plan_of(name).groups]
    known = {"plastic", "metal_tube", "wood", "allen_key"}
    assert materials & {group.material for group in trained} == known
    assert len(materials) == objects


def test_the_eighth_sealed_plan_has_every_class_of_mount_and_both_ways_of_leading() -> None:
    plan = plan_of("sealed_8")
    assert {group.world or plan.world for group in plan.groups} == {"plausible"}
    drawn = [one.mount for one in assignments(plan) if one.group.name.startswith("hold_")]
    assert {*drawn} == {"bolted", "light", "soft"}
    assert 0.55 < drawn.count("bolted") / len(drawn) < 0.85
    assert {one.mount for one in assignments(plan) if one.group.name == "mount_soft"} == {"soft"}
    wide = [group for group in plan.groups if group.places == (0.01, 0.19)]
    assert {group.approach for group in wide} == {"robot", "hand"}
    assert min(ends(group.hold)[0] for group in wide) >= 2.0


@pytest.mark.parametrize(
    "plan", [pytest.param(name, marks=[pytest.mark.slow] * (name != NEWEST)) for name in SEALED]
)
def test_each_build_of_a_sealed_plan_has_100_touches_to_know_and_100_to_score(plan: str) -> None:
    sessions = assignments(plan_of(plan))
    counts: dict[int | None, int] = {}
    for one in sessions:
        if one.group.name.startswith("hold_"):
            counts[one.build] = counts.get(one.build, 0) + len(one.cells())
    assert set(counts.values()) == {200}
    sensors = [one.sensor() for one in sessions]
    pitch = [np.sqrt(1.0 + each.drift / each.string.tension) - 1.0 for each in sensors]
    assert min(pitch) < -0.02
    assert max(pitch) > 0.02


@pytest.mark.parametrize(("training", "share"), [("builds_3", 0.03), ("grips", 0.2)])
def test_training_has_a_build_a_session_and_shares_nothing_with_a_test(training: str, share: float) -> None:
    plan = plan_of(training)
    sessions = assignments(plan)
    builds = [one.build or 0 for one in sessions]
    assert len(builds) == len(set(builds)) == max(builds) - min(builds) + 1
    others = [group for name in every() if name != training for group in plan_of(name).groups]
    assert not {*builds} & {build for group in others for build in _builds(group)}
    assert not {one.day for one in sessions} & {day for group in others for day in group.days}
    # What a session draws depends on its name: equal names would be equal speech, songs and strokes.
    tests = {group.name for name in SEALED for group in plan_of(name).groups}
    assert not {group.name for group in plan.groups} & tests
    ideal = [one for one in sessions if one.world == "ideal"]
    assert 0 < len(ideal) < share * len(sessions)


@pytest.mark.parametrize("name", ["sealed_9", "builds_3"])
def test_plans_of_stories_have_every_story(name: str) -> None:
    groups = plan_of(name).groups
    for option in ("swing", "vibrato", "again", "in_turn", "driver_dies", "on_touched", "detuned"):
        assert any(getattr(group, option) for group in groups), option
    assert any(group.protocol == "tap" for group in groups)
    assert any(isinstance(group.second, tuple) and group.in_turn is None for group in groups)
    assert any(group.pause is not None and ends(group.pause)[1] == 30.0 for group in groups)
    assert {"drawn", "synthetic speech"} <= {group.music for group in groups}
    assert max(group.forces[1] for group in groups) >= 8.0
    assert max(group.speeds[1] for group in groups) == 0.3
    faults = {
        fault
        for group in groups
        if (one := group.deviation) is not None
        for fault in (("driver", one.dead_driver), ("microphone", one.dead_microphone), one.swapped)
    }
    assert {("driver", 1), ("driver", 2), ("microphone", 1), ("microphone", 2), True} <= faults
    detuned = [one.deviation.tuning or 0.0 for one in assignments(plan_of(name)) if one.group.detuned]
    assert min(detuned) < -0.2
    assert max(detuned) > 0.2
