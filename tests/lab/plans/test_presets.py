import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.lab.course import course
from monochord.lab.plan import Plan, assignments
from monochord.lab.plans import load_plan, plan_names


def windows(plan: Plan, name: str, kind: str) -> int:
    """Whole windows of 0.1 s on a grid that the phases of a group surely hold."""
    sessions = [one for one in assignments(plan) if one.group.name == name]
    phases = [phase for one in sessions for phase in course(one).motion.phases if phase.kind == kind]
    return sum(max(0, int((phase.stop - phase.start) / 0.1 + 1e-6) - 1) for phase in phases)


@pytest.mark.parametrize("name", plan_names())
def test_every_plan_loads_and_names_its_source(name: str) -> None:
    plan = load_plan(name)
    assert plan.title
    assert plan.source
    assert "simulated" in plan.notes


def test_the_small_plan_is_a_minute() -> None:
    lengths = [course(one).motion.end for one in assignments(load_plan("small"))]
    assert len(lengths) in (2, 3)
    assert 40.0 < sum(lengths) < 70.0


def test_the_plan_of_the_paper_has_its_windows_range_and_objects() -> None:
    plan = load_plan("paper")
    assert windows(plan, "static", "hold") >= 0.9 * 10791  # the rest stands in "settle"
    assert windows(plan, "slip", "slide") >= 6795
    cells = np.concatenate([one.cells() for one in assignments(plan) if one.group.name == "static"])
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
    lengths = [course(one).motion.end for one in assignments(load_plan("paper"))[::9]]
    assert 45.0 < min(lengths) <= max(lengths) < 75.0


def test_an_unknown_plan_is_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'small'"):
        load_plan("smal")
