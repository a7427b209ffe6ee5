import json

import numpy as np
import pytest
from tests.lab.tiny import session, tiny

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.lab.assignment import Assignment, assignments
from monochord.lab.deviation import Deviation
from monochord.lab.offline import describe
from monochord.lab.plan import Delays, Group, Plan
from monochord.lab.plans import load_plan, plan_names
from monochord.lab.schedule import schedule
from monochord.physics.sensors import load_sensor
from monochord.physics.twin.world import only

GRID = Group(name="a", grid=(5, 4), sessions=3, radii=(0.002, 0.004), days=(1, 2), forces=(0.1, 2.0))
PLAN = Plan(name="p", groups=(GRID, Group(name="b", like="a", sessions=2, lifted=3e-3)))


def test_every_cell_of_the_grid_is_used_once_for_each_radius() -> None:
    sessions = [one for one in assignments(PLAN) if one.group.name == "a"]
    for radius in GRID.radii:
        cells = np.concatenate([one.cells() for one in sessions if one.radius == radius])
        row = np.floor((cells[:, 0] - 0.05) / 0.1 * 5).astype(int)
        column = np.floor((cells[:, 1] - 0.1) / 1.9 * 4).astype(int)
        assert sorted(zip(row.tolist(), column.tolist(), strict=True)) == [
            (i, j) for i in range(5) for j in range(4)
        ]
    every = np.concatenate([one.cells() for one in sessions])
    assert len(np.unique(every[:, 0])) == len(np.unique(every[:, 1])) == len(every) == 40


def test_names_days_and_radii_cycle() -> None:
    sessions = assignments(PLAN)
    assert [one.name for one in sessions] == [*(f"a_{i:03d}" for i in range(6)), "b_000", "b_001"]
    assert [one.day for one in sessions[:6]] == [1, 2, 1, 2, 1, 2]
    assert [one.radius for one in sessions[:6]] == [0.002] * 3 + [0.004] * 3
    assert len({one.epoch for one in sessions}) == len(sessions)


def test_builds_cycle_before_days_and_draw_other_sensors() -> None:
    plan = tiny(groups=(Group(name="a", sessions=5, builds=(7, 8), days=(1, 2)),), build=3)
    sessions = assignments(plan)
    assert [(one.build, one.day) for one in sessions] == [(7, 1), (8, 1), (7, 2), (8, 2), (7, 1)]
    strings = [one.sensor().string for one in sessions]
    assert strings[0] == strings[2] != strings[1]
    assert [one.build for one in assignments(tiny(build=3))] == [3, 3]


def test_a_plausible_world_has_its_own_sensors_and_grippers() -> None:
    groups = (Group(name="a", sessions=4, builds=(7, 8)), Group(name="b", world="ideal", builds=(7,)))
    *plausible, ideal = assignments(tiny(groups=groups, world="plausible"))
    motion = schedule(ideal).motion.keys
    touches = [one.touch(motion) for one in plausible]
    assert touches[0] == touches[2] != touches[1]
    assert [bool(one.touch(motion).mount.modes) for one in (*plausible, ideal)] == [True] * 4 + [False]
    assert ideal.sensor().drivers[0].bias == 0.0 != plausible[0].sensor().drivers[0].bias
    still = assignments(tiny(groups=groups, world="plausible", effects=only("hum")))[0]
    assert still.touch(motion) == ideal.touch(motion)
    assert still.sensor().drivers[0].bias == 0.0


def test_a_group_may_deviate_otherwise_than_its_plan() -> None:
    groups = (Group(name="a"), Group(name="b", deviation=Deviation(dead_driver=2)))
    first, second = assignments(tiny(groups=groups, deviation=Deviation(drive=2.0)))
    assert [one.level for one in first.sensor().drivers] == [2.0, 2.0]
    assert [one.level for one in second.sensor().drivers] == [1.0, 1.0]
    assert second.sensor().drivers[1].limit == 0.0 < first.sensor().drivers[1].limit


def test_a_group_says_whether_its_objects_roll_whatever_motions_it_repeats() -> None:
    groups = (Group(name="a", protocol="slide", rolls=True), Group(name="b", like="a"))
    rolling, sliding = assignments(tiny(groups=groups, world="plausible"))
    motion = schedule(rolling).motion.keys
    assert motion == schedule(sliding).motion.keys
    assert rolling.touch(motion).rolls
    assert not sliding.touch(motion).rolls


def test_a_drawn_design_is_a_sessions_own_and_described() -> None:
    first, second = assignments(tiny(groups=(Group(name="a", design="drawn", sessions=2, grid=(2, 1)),)))
    plain = load_sensor("prototype")
    assert first.design() == first.design() != second.design() != plain
    assert first.design().string == plain.string == first.sensor().string
    assert describe(first).sensor == to_tree(first.design())
    for one in (first, second):
        low, high = one.design().drivers
        assert max(low.sense, low.drive) < 0.5 * plain.string.length < min(high.sense, high.drive)


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [("drawn", 3e8, 2.1e11), ("drawn_smooth", 3e10, 2.1e11), ("drawn_soft", 5e5, 3e8)],
)
def test_a_drawn_object_is_the_sessions_own(name: str, least: float, most: float) -> None:
    first, second = assignments(tiny(groups=(Group(name="a", sessions=2, material=name),)))
    assert all(least <= each.material.young_modulus <= most for each in (first, second))
    assert first.material == first.material != second.material
    assert first.radius == first.material.radius != second.radius


def test_a_group_like_another_has_its_motions() -> None:
    first, second = assignments(PLAN)[6:]
    assert (first.origin.name, second.origin.name) == ("a_000", "a_003")
    assert second.radius == 0.004
    np.testing.assert_array_equal(second.cells(), assignments(PLAN)[3].cells())


def test_seeds_draw_other_cells_and_a_day_another_sensor() -> None:
    assert not np.array_equal(session("hold_000").cells(), session("hold_000", seed=1).cells())
    assert session("hold_000").sensor().drift != session("slide_000").sensor().drift == 0.0


def test_a_plan_is_strict_and_goes_through_text() -> None:
    assert from_tree(Plan, to_tree(PLAN)) == PLAN
    with pytest.raises(InputError, match="gird"):
        from_tree(Plan, {"name": "p", "groups": [{"name": "a", "gird": [1, 1]}]})


@pytest.mark.parametrize(
    ("groups", "given"),
    [
        ((), "none"),
        ((GRID, GRID), "a"),
        ((Group(name="b", like="c"),), "'c'"),
        ((GRID, Group(name="b", like="a"), Group(name="c", like="b")), "like"),
        ((Group(name="b", material="glass"),), "glass"),
        ((Group(name="b", music="absent.wav"),), "absent.wav"),
    ],
)
def test_plans_that_cannot_be(groups: tuple[Group, ...], given: str) -> None:
    with pytest.raises(InputError, match=given):
        tiny(groups=groups)


@pytest.mark.parametrize(
    "options", [{"name": "A b"}, {"name": "a", "forces": (2.0, 1.0)}, {"name": "a", "forces": (1.0, 11.0)},
                {"name": "a", "days": ()}, {"name": "a", "days": (10**400,)},
                {"name": "a", "oblique": (0.0, 3.0)},
                {"name": "a", "clearances": (0.0, 1e-4)}, {"name": "a", "grid": (100000, 100000)}],
)  # fmt: skip
def test_groups_that_cannot_be(options: dict[str, object]) -> None:
    with pytest.raises(InputError, match=r"(?i)group"):
        Group(**options)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("span", [(0.1, 0.05), (-0.1, 0.1), (0.0, 60.0)])
def test_delays_that_cannot_be(span: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="pose"):
        Delays(pose=span)


def windows(sessions: list[Assignment], name: str, kind: str) -> int:
    """Whole windows of 0.1 s on a grid that the phases of a group surely hold."""
    own = [one for one in sessions if one.group.name == name]
    phases = [phase for one in own for phase in schedule(one).motion.phases if phase.kind == kind]
    return sum(max(0, int((phase.stop - phase.start) / 0.1 + 1e-6) - 1) for phase in phases)


@pytest.mark.parametrize("name", plan_names())
def test_every_plan_loads_and_names_its_source(name: str) -> None:
    plan = load_plan(name)
    assert plan.title
    assert plan.source


def test_the_small_plan_is_a_minute() -> None:
    lengths = [schedule(one).motion.end for one in assignments(load_plan("small"))]
    assert len(lengths) in (2, 3)
    assert 40.0 < sum(lengths) < 70.0


def test_the_plan_of_the_paper_has_its_windows_range_and_objects() -> None:
    plan = load_plan("paper")
    sessions = assignments(plan)
    assert windows(sessions, "static", "hold") >= 0.9 * 10791  # the rest stands in "settle"
    assert windows(sessions, "slip", "slide") >= 6795
    cells = np.concatenate([one.cells() for one in sessions if one.group.name == "static"])
    assert len(cells) == 3 * 26 * 16
    assert np.ptp(cells[:, 0]) > 0.095
    assert cells[:, 1].min() < 0.1
    assert 1.95 < cells[:, 1].max() <= 2.0
    materials = {group.material for group in plan.groups}
    assert materials == {"plastic", "metal_tube", "wood", "allen_key"}
    speeds = {group.speeds for group in plan.groups if group.protocol == "slide"}
    assert speeds == {(0.001, 0.03)}
    assert any(group.music for group in plan.groups)


def test_sessions_of_the_paper_last_about_a_minute() -> None:
    lengths = [schedule(one).motion.end for one in assignments(load_plan("paper"))[::40]]
    assert 45.0 < min(lengths) <= max(lengths) < 75.0


def test_with_a_first_build_each_session_is_of_a_build_of_its_own() -> None:
    group = Group(name="a", sessions=3, first_build=2001, days=(1, 2))
    sessions = assignments(Plan(name="p", groups=(group,)))
    assert [(one.build, one.day) for one in sessions] == [(2001, 1), (2002, 2), (2003, 1)]
    with pytest.raises(InputError, match="first_build"):
        Group(name="a", builds=(1,), first_build=2)


def test_an_unknown_plan_is_refused() -> None:
    with pytest.raises(InputError, match="smal"):
        load_plan("smal")


def test_a_session_says_how_its_object_is_held_and_what_a_ruler_says() -> None:
    groups = (
        Group(name="a", sessions=8, builds=tuple(range(8))),
        Group(name="b", sessions=3, builds=(1, 2, 3), mount="soft"),
        Group(name="c", world="ideal", builds=(1,)),
    )
    sessions = assignments(tiny(groups=groups, world="plausible"))
    described = [describe(one).more for one in sessions]
    assert {more["mount"] for more in described[:8]} <= {"bolted", "light", "soft"}
    assert {more["mount"] for more in described[8:11]} == {"soft"}
    lengths = json.loads(described[0]["length"])
    assert lengths["true"] == sessions[0].sensor().string.length
    assert 0.0 < abs(lengths["measured"] - lengths["true"]) <= 5e-4
    assert "mount" not in described[11]
    assert "length" not in described[11]
