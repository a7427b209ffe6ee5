"""The environment Grasp-v0: spaces, seeds, costs, and what it refuses."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from monochord.core.errors import InputError
from monochord.sim.grasp_env import GraspEnv

HARDER, SAME = np.array([1.0], np.float32), np.array([0.0], np.float32)


@pytest.mark.parametrize("observation", ["estimates", "sound", "features"])
def test_gymnasium_finds_no_fault_with_it(observation: str) -> None:
    env = gymnasium.make("monochord.sim:monochord/Grasp-v0", observation=observation)
    check_env(env.unwrapped, skip_render_check=True)  # a warning is an error here


def test_a_seed_draws_object_weight_and_friction() -> None:
    env = GraspEnv()
    drawn = [env.reset(seed=seed)[1] for seed in (1, 1, 2, 3)]
    assert drawn[0] == drawn[1]
    assert len({each["needed"] for each in drawn}) == 3
    assert env.reset(seed=1, options={"object": "dowel"})[1]["object"] == "dowel"


def test_a_grip_that_holds_is_caught_and_costs_what_is_spare() -> None:
    env, costs = GraspEnv(), list[float]()
    _, info = env.reset(seed=5, options={"object": "dowel"})
    truncated = False
    while not truncated:
        harder = info.get("grip", 0.0) < 1.3 * info["needed"]
        observation, reward, terminated, truncated, info = env.step(HARDER if harder else SAME)
        info = {**info, "grip": float(observation["grip"][0])}
        costs.append(-reward)
        assert not terminated
    assert info["caught"]
    spare = info["grip"] / info["needed"] - 1.0
    assert costs[-1] == pytest.approx(0.02 * spare, abs=2e-3)  # it creeps
    assert min(costs) >= 0.0


def test_what_is_not_held_sinks_with_the_table_and_costs_it() -> None:
    env, cost = GraspEnv(), 0.0
    _, info = env.reset(seed=5, options={"object": "dowel"})
    ended = False
    while not ended:
        _, reward, terminated, truncated, info = env.step(-HARDER)
        cost, ended = cost - reward, terminated or truncated
    assert info["drop"] > 0.03
    assert not info["caught"]
    assert cost == pytest.approx(info["drop"] / 0.015, rel=0.01)


def test_bad_input_is_refused_in_one_line() -> None:
    with pytest.raises(InputError, match="render_mode 'human'"):
        GraspEnv(render_mode="human")
    env = GraspEnv()
    with pytest.raises(InputError, match=r"reset\(\) first"):
        env.step(SAME)
    with pytest.raises(InputError, match=r"object 'cup'.*dowel"):
        env.reset(options={"object": "cup"})
    env.reset(seed=1)
    for bad in (np.array([np.nan]), np.zeros(2), np.float32(0.0)):
        with pytest.raises(InputError, match=r"-1 to 1|numbers"):
            env.step(bad)  # pyright: ignore[reportArgumentType]
