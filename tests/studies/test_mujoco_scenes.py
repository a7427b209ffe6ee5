"""The studies of strings in MuJoCo, kept short."""

import pytest
from studies.grasp_by_slip import GraspBySlip
from studies.mujoco_scenes import MujocoScenes

from monochord.core.errors import InputError
from studies import mujoco_scenes


@pytest.mark.slow
def test_a_string_costs_less_than_real_time_beside_mujoco() -> None:
    rows = list(mujoco_scenes._cost_rows())
    assert len(rows) == 2
    for row in rows:
        assert row.baseline == "MuJoCo alone"
        assert row.baseline_value is not None
        assert 0.0 < row.baseline_value < row.value < 1000.0


@pytest.mark.slow
def test_a_block_between_two_strings_is_told_and_not_placed() -> None:
    rows = {row.name: row.value for row in mujoco_scenes._block_rows("plausible", "demo")}
    assert rows["block, plausible: windows in contact"] > 200
    assert rows["block, plausible: at two edges"] > 0.9
    assert rows["block, plausible: contact decided"] > 0.95
    assert rows["block, plausible: place answered"] < 0.05


@pytest.mark.slow
def test_the_reflex_catches_more_than_its_first_grip() -> None:
    rows = {row.name: row.value for row in GraspBySlip(episodes=6, first=1000).run()}
    assert rows["all: drops"] == 6
    assert rows["all: caught within 15 mm"] >= 4
    assert rows["all: caught by 0.6 N without the reflex"] < rows["all: caught within 15 mm"]


def test_impossible_options_are_refused() -> None:
    with pytest.raises(InputError, match="0 seeds: expected 1 to 1000"):
        MujocoScenes(seeds=0)
    with pytest.raises(InputError, match="2 episodes"):
        GraspBySlip(episodes=2)
    with pytest.raises(InputError, match="world 'real'"):
        GraspBySlip(world="real")
