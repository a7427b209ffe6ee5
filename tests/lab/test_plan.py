import numpy as np
import pytest
from tests.lab.tiny import session, tiny

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.lab.plan import Delays, Group, Plan, assignments

GRID = Group(name="a", grid=(5, 4), sessions=3, radii=(0.002, 0.004), days=(1, 2), forces=(0.1, 2.0))
PLAN = Plan(name="p", groups=(GRID, Group(name="b", like="a", sessions=2, lifted=3e-3)))


def test_every_cell_of_the_grid_is_dealt_once_for_each_radius() -> None:
    told = [one for one in assignments(PLAN) if one.group.name == "a"]
    for radius in GRID.radii:
        cells = np.concatenate([one.cells() for one in told if one.radius == radius])
        row = np.floor((cells[:, 0] - 0.05) / 0.1 * 5).astype(int)
        column = np.floor((cells[:, 1] - 0.1) / 1.9 * 4).astype(int)
        assert sorted(zip(row.tolist(), column.tolist(), strict=True)) == [
            (i, j) for i in range(5) for j in range(4)
        ]
    every = np.concatenate([one.cells() for one in told])
    assert len(np.unique(every[:, 0])) == len(np.unique(every[:, 1])) == len(every) == 40


def test_names_days_and_radii_go_round() -> None:
    told = assignments(PLAN)
    assert [one.name for one in told] == [*(f"a_{i:03d}" for i in range(6)), "b_000", "b_001"]
    assert [one.day for one in told[:6]] == [1, 2, 1, 2, 1, 2]
    assert [one.radius for one in told[:6]] == [0.002] * 3 + [0.004] * 3
    assert len({one.epoch for one in told}) == len(told)


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
    with pytest.raises(InputError, match="did you mean 'grid'"):
        from_tree(Plan, {"name": "p", "groups": [{"name": "a", "gird": [1, 1]}]})


@pytest.mark.parametrize(
    ("groups", "line"),
    [
        ((), "groups none"),
        ((GRID, GRID), "names of their own"),
        ((Group(name="b", like="c"),), "group 'c'"),
        ((GRID, Group(name="b", like="a"), Group(name="c", like="b")), "a motion of its own"),
        ((Group(name="b", material="glass"),), "material 'glass'"),
        ((Group(name="b", music="absent.wav"),), "music 'absent.wav'"),
    ],
)
def test_plans_that_cannot_be(groups: tuple[Group, ...], line: str) -> None:
    with pytest.raises(InputError, match=line):
        tiny(groups=groups)


@pytest.mark.parametrize(
    "options", [{"name": "A b"}, {"name": "a", "forces": (2.0, 1.0)}, {"name": "a", "forces": (1.0, 9.0)},
                {"name": "a", "days": ()}, {"name": "a", "grid": (100000, 100000)}],
)  # fmt: skip
def test_groups_that_cannot_be(options: dict[str, object]) -> None:
    with pytest.raises(InputError, match="group"):
        Group(**options)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("span", [(0.1, 0.05), (-0.1, 0.1), (0.0, 60.0)])
def test_delays_that_cannot_be(span: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="delays of pose"):
        Delays(pose=span)
