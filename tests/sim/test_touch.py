"""The environment Touch-v0: a fingertip above a string, alone and many at once."""

import subprocess
import sys
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from monochord.core.errors import InputError
from monochord.sim.touch_env import TouchEnv, TouchVectorEnv
from monochord.sim.touch_picture import FINGER, GOAL, TOLD, touch_picture
from monochord.sim.touch_reflex import touch_reflex
from monochord.sim.touch_task import OVERLOAD
from monochord.sim.warm import warm_string

NAME = "monochord/Touch-v0"
KINDS = ("estimates", "sound", "features")
TASKS = ("find", "hold", "follow")


def many(count: int, **options: Any) -> TouchVectorEnv:
    envs = gymnasium.make_vec(NAME, num_envs=count, vectorization_mode="vector_entry_point", **options)
    assert isinstance(envs, TouchVectorEnv)
    return envs


def alike(first: Any, second: Any) -> bool:
    return first.keys() == second.keys() and all(
        first[name].dtype == second[name].dtype and np.array_equal(first[name], second[name])
        for name in first
    )


def test_one_line_makes_it_in_a_fresh_interpreter() -> None:
    made = f"gymnasium.make('monochord.sim:{NAME}', observation='sound')"
    code = f"import gymnasium\nprint({made}.reset(seed=1)[0]['touch'].shape)"
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert run.stdout.strip() == "(2, 4410)", run.stderr


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("observation", KINDS)
def test_gymnasium_finds_nothing_to_warn_of(observation: str, task: str) -> None:
    env = gymnasium.make(NAME, observation=observation, task=task, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


def test_an_episode_is_its_seed() -> None:
    runs: list[list[Any]] = []
    for seed in (1, 1, 2):
        env = gymnasium.make(NAME, world="plausible", builds=2)
        rows = [env.reset(seed=seed)[0]]
        rows += [env.step(np.array([0.3, 0.5], np.float32))[0] for _ in range(20)]
        runs.append(rows)
    assert all(alike(first, second) for first, second in zip(*runs[:2], strict=True))
    assert not alike(runs[0][0], runs[2][0])


def test_a_reset_makes_no_string_anew_and_hears_nothing_of_the_episode_before() -> None:
    env = TouchEnv(observation="sound")
    before, _ = env.reset(seed=3)
    made = warm_string.cache_info().misses
    for _ in range(10):
        env.step(np.array([0.0, 1.0], np.float32))
    after, _ = env.reset(seed=3)
    assert alike(before, after)
    assert warm_string.cache_info().misses == made


def test_episodes_draw_from_the_builds_asked_for() -> None:
    def sounds(**options: Any) -> set[bytes]:
        env = TouchEnv(observation="sound", **options)
        return {env.reset(seed=seed)[0]["touch"].tobytes() for seed in range(16)}

    design, some, others = sounds(), sounds(builds=3), sounds(builds=2, first_build=50)
    assert [len(each) for each in (design, some, others)] == [1, 3, 2]
    assert len(design | some | others) == 6


@pytest.mark.parametrize("observation", KINDS)
def test_many_together_are_each_of_them_alone(observation: str) -> None:
    count, steps, length = 3, 9, 4
    options: dict[str, Any] = {"observation": observation, "world": "plausible", "builds": 2}
    envs = many(count, max_episode_steps=length, **options)
    singles = [gymnasium.make(NAME, max_episode_steps=length, **options) for _ in range(count)]
    seed: Any = np.int64(7)
    together, _ = envs.reset(seed=seed)
    alone = [env.reset(seed=7 + number)[0] for number, env in enumerate(singles)]
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (steps, count, 2)).astype(np.float32)
    actions[:, :, 1] = 1.0
    over = [False] * count
    for each in actions:
        together, rewards, _, truncated, _ = envs.step(each)
        for number, env in enumerate(singles):
            if over[number]:
                (alone[number], _), reward, late = env.reset(), 0.0, False
            else:
                alone[number], reward, _, late, _ = env.step(each[number])
            over[number] = late
            assert (rewards[number], truncated[number]) == (reward, late)
            assert alike({name: rows[number] for name, rows in together.items()}, alone[number])
    assert envs.observation_space.contains(together)


def test_the_same_step_returns_the_next_episode_and_the_last_observation() -> None:
    options: dict[str, Any] = {"max_episode_steps": 3, "observation": "sound"}
    later, same = many(2, **options), many(2, autoreset_mode="SameStep", **options)
    later.reset(seed=5)
    same.reset(seed=5)
    down = np.array([[0.0, 1.0]] * 2, np.float32)
    for _ in range(2):
        assert "final_obs" not in same.step(down)[4]
        later.step(down)
    last, _, _, truncated, truth = later.step(down)
    begun, *_ = later.step(down)
    observation, _, _, also_truncated, infos = same.step(down)
    assert truncated.all()
    assert also_truncated.all()
    assert alike(observation, begun)
    for number in range(2):
        assert alike(infos["final_obs"][number], {name: rows[number] for name, rows in last.items()})
        assert infos["final_info"]["position"][number] == truth["position"][number]


def oracle(info: dict[str, Any], action: Callable[[float, float], tuple[float, float]]) -> Any:
    return np.array(action(info.get("position_error", 0.0), info.get("force_error", -1.0)), np.float32)


@pytest.mark.parametrize("task", TASKS)
def test_the_goal_is_worth_one_and_untouched_nothing(task: str) -> None:
    env = TouchEnv(task=task, observation="sound")
    env.reset(seed=2)
    info: dict[str, Any] = {}
    rewards: list[float] = []
    for _ in range(150):
        action = oracle(info, lambda place, force: (-300.0 * place, -0.5 * force))
        _, reward, terminated, _, info = env.step(np.clip(action, -1.0, 1.0))
        assert not terminated
        assert (reward > 0.0) <= bool(info["contact"])
        rewards.append(reward)
    assert rewards[0] == 0.0
    assert np.mean(rewards[-50:]) > 0.9
    assert abs(info["position_error"]) < 2e-3


def test_too_much_force_ends_an_episode() -> None:
    envs = many(2, observation="sound")
    envs.reset(seed=1)
    down = np.array([[0.0, 1.0], [0.0, -1.0]], np.float32)
    _, _, terminated, truncated, infos = envs.step(down)
    for _ in range(60):
        if not terminated.any():
            _, _, terminated, truncated, infos = envs.step(down)
    assert terminated.tolist() == [True, False]
    assert not truncated.any()
    assert infos["force"][0] > 0.8 * OVERLOAD
    assert infos["contact"].tolist() == [1.0, 0.0]


@pytest.mark.parametrize("task", TASKS)
def test_the_reflex_reaches_the_goal_by_the_estimates(task: str) -> None:
    envs = many(2, task=task, world="plausible", builds=2, first_build=201)
    observation, _ = envs.reset(seed=11)
    rewards: list[Any] = []
    truth: dict[str, Any] = {}
    for _ in range(100):
        observation, reward, terminated, _, truth = envs.step(touch_reflex(observation))
        assert not terminated.any()
        assert envs.observation_space.contains(observation)
        rewards.append(reward)
    assert np.median(np.abs(truth["position_error"])) < 2e-3
    assert np.mean(truth["contact"]) == 1.0
    assert np.mean(rewards[-50:]) > 0.7


def shows(env: Any, colour: tuple[int, int, int]) -> bool:
    return bool((env.render() == colour).all(axis=2).any())


def test_a_picture_shows_finger_goal_and_estimate() -> None:
    def place(picture: Any, colour: tuple[int, int, int]) -> Any:
        return np.nonzero((picture[:, 24:] == colour).all(axis=2))[1].mean() + 24

    options: dict[str, Any] = {"length": 0.2, "height": 0.0, "force": 1.0, "goal": (0.15, 1.0)}
    picture = touch_picture(place=0.05, told=(0.1, 1e-3), **options)
    columns = [place(picture, colour) for colour in (FINGER, TOLD, GOAL)]
    assert columns == pytest.approx([132, 240, 348], abs=1.0)
    env = gymnasium.make(NAME, task="hold", render_mode="rgb_array")
    observation, _ = env.reset(seed=1)
    assert not shows(env, TOLD)
    for _ in range(60):
        observation, *_ = env.step(touch_reflex(observation))
    assert shows(env, TOLD)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"task": "fold"}, ("task", "find", "hold", "follow")),
        ({"tsk": "find"}, ("tsk", "did you mean 'task'")),
        ({"observation": "smell"}, ("observation", "estimates")),
        ({"world": "real"}, ("world", "plausible")),
        ({"hop": 0.001}, ("hop", "0.01")),
        ({"builds": -1}, ("builds", "0 or more")),
        ({"sensor": "prototpye"}, ("prototpye", "did you mean 'prototype'")),
        ({"material": "plastc"}, ("plastc", "did you mean 'plastic'")),
        ({"model": "dmo"}, ("dmo", "demo")),
        ({"observation": "features", "feature": "fft"}, ("fft", "fft_harmonic")),
        ({"render_mode": "human"}, ("human", "rgb_array")),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(options: dict[str, Any], words: tuple[str, ...]) -> None:
    for make in (lambda: TouchEnv(**options), lambda: TouchVectorEnv(2, **options)):
        with pytest.raises(InputError) as error:
            make()
        assert all(word in str(error.value) for word in words), str(error.value)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "action", [[np.nan, 0.0], [0.0, np.inf], [0.0], [0.0, 0.0, 0.0], "down", [[0.0, 0.0]]]
)
def test_an_action_that_is_none_is_refused_and_moves_nothing(action: Any) -> None:
    env = TouchEnv(observation="sound")
    env.reset(seed=1)
    expected = [env.reset(seed=1)[0], env.step([0.0, 1.0])[0]]  # pyright: ignore[reportArgumentType]
    assert alike(env.reset(seed=1)[0], expected[0])
    with pytest.raises(InputError, match="action"):
        env.step(action)
    assert alike(env.step(np.array([0.0, 1.0], np.float32))[0], expected[1])


def test_many_are_refused_what_they_cannot_be() -> None:
    with pytest.raises(InputError, match="autoreset_mode"):
        TouchVectorEnv(2, autoreset_mode="Never")
    with pytest.raises(InputError, match="num_envs"):
        TouchVectorEnv(0)
    envs = TouchVectorEnv(2, observation="sound")
    with pytest.raises(InputError, match="reset"):
        envs.step(np.zeros((2, 2), np.float32))
    with pytest.raises(InputError, match="3 seeds"):
        envs.reset(seed=[1, 2, 3])
    envs.reset(seed=1)
    with pytest.raises(InputError, match="actions"):
        envs.step(np.zeros(2, np.float32))


def test_an_environment_alone_is_reset_before_it_steps() -> None:
    with pytest.raises(InputError, match="reset"):
        TouchEnv(observation="sound").step(np.zeros(2, np.float32))


def test_actions_beyond_one_are_one() -> None:
    env = TouchEnv(observation="sound")
    runs: list[Any] = []
    for action in ([1.0, 1.0], [7.0, 7.0]):
        env.reset(seed=1)
        runs.append(env.step(np.array(action, np.float32))[0])
    assert alike(*runs)
