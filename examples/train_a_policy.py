"""Train a policy that follows a goal along a simulated string, and compare it with the scripted reflex.

Run it: python examples/train_a_policy.py
It takes some minutes on two cores, and needs the extra `policy`. A number of steps may follow.
"""

import sys
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv

from monochord.sim.observation import ESTIMATES
from monochord.sim.touch_reflex import touch_reflex

STEPS = 200_000
ENVIRONMENTS, EPISODES = 32, 128
WINDOWS = 3
"""Windows that the policy sees at once."""
SETTINGS = {"task": "follow", "world": "plausible", "builds": 32}
UNSEEN = 201
"""First of the builds that both are compared on."""
COLUMN = {name: number for number, name in enumerate(ESTIMATES)}

Rows = NDArray[np.float32]
Policy = Callable[[Mapping[str, Rows]], Rows]


def environments(**options: Any) -> Any:
    """Return environments that step together."""
    mode = {"vectorization_mode": "vector_entry_point", "autoreset_mode": "SameStep"}
    return gymnasium.make_vec("monochord.sim:monochord/Touch-v0", ENVIRONMENTS, **mode, **SETTINGS, **options)


def inputs(observation: Mapping[str, Rows]) -> Rows:
    """Return what the policy sees of a window: errors of place (5 mm) and force (1 N), certainty, its arm."""
    touch, arm, goal = observation["touch"], observation["arm"], observation["goal"]
    place = 40.0 * (goal[:, 0] - touch[:, COLUMN["position"]]) * touch[:, COLUMN["position stated"]]
    force = (goal[:, 1] - touch[:, COLUMN["force"]]) * touch[:, COLUMN["force stated"]]
    names = ("contact", "touched", "sliding", "force stated", "force error")
    others = touch[:, [COLUMN[name] for name in names]]
    rows = np.column_stack([place, force, others, 10.0 * arm[:, 0], 5.0 * arm[:, 1], goal[:, 1]])
    return np.clip(rows, -5.0, 5.0).astype(np.float32)


def with_latest(rows: Rows, latest: Rows, begun: Any) -> Rows:
    """Return the inputs of the last windows; where an episode has begun, its first ones, repeated."""
    later = np.concatenate((rows[:, latest.shape[1] :], latest), axis=1)
    later[begun] = np.tile(latest[begun], WINDOWS)
    return later


class Environments(VecEnv):
    """The environments as stable-baselines3 takes them."""

    def __init__(self) -> None:
        self.envs = environments()
        columns = inputs(self.envs.reset(seed=1)[0]).shape[1]
        self.rows: Rows = np.zeros((ENVIRONMENTS, WINDOWS * columns), np.float32)
        space = Box(-5.0, 5.0, self.rows.shape[1:], np.float32)
        super().__init__(ENVIRONMENTS, space, self.envs.single_action_space)

    def reset(self) -> Rows:
        """Begin an episode everywhere."""
        self.rows = with_latest(self.rows, inputs(self.envs.reset()[0]), slice(None))
        return self.rows

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions."""
        self.actions = actions

    def step_wait(self) -> tuple[Rows, Rows, NDArray[np.bool_], list[dict[str, Any]]]:
        """Step everywhere."""
        observation, rewards, terminated, truncated, infos = self.envs.step(self.actions)
        ended, told = terminated | truncated, [dict[str, Any]() for _ in range(ENVIRONMENTS)]
        for number in np.flatnonzero(ended).tolist():
            last = inputs({name: row[np.newaxis] for name, row in infos["final_obs"][number].items()})
            row = with_latest(self.rows[[number]], last, [])[0]
            told[number] = {"terminal_observation": row, "TimeLimit.truncated": bool(truncated[number])}
        self.rows = with_latest(self.rows, inputs(observation), ended)
        return self.rows, rewards.astype(np.float32), ended, told

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:  # noqa: ARG002
        """Return an attribute, which all share."""
        return [getattr(self.envs, attr_name)] * ENVIRONMENTS

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:  # noqa: ARG002
        """Set an attribute, which all share."""
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **named: Any) -> list[Any]:  # noqa: ARG002
        """Call a method, once for all."""
        return [getattr(self.envs, method_name)(*args, **named)] * ENVIRONMENTS

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:  # noqa: ARG002
        """Return that none is."""
        return [False] * ENVIRONMENTS


def policy_of(model: PPO) -> Policy:
    """Return a trained model as a function of the observations of environments that begin now."""
    rows: list[Rows] = []

    def act(observation: Mapping[str, Rows]) -> Rows:
        latest = inputs(observation)
        before = rows.pop() if rows else np.tile(latest, WINDOWS)
        rows.append(with_latest(before, latest, []))
        return model.predict(rows[0], deterministic=True)[0].astype(np.float32)

    return act


def score(name: str, begin: Callable[[], Policy]) -> NDArray[Any]:
    """Return what each episode brings on builds not trained on, and print it with errors after 1 s."""
    envs, scores, errors = environments(first_build=UNSEEN), list[Any](), list[Any]()
    for first in range(0, EPISODES, ENVIRONMENTS):
        act, (observation, _) = begin(), envs.reset(seed=1000 + first)
        returns, running = np.zeros(ENVIRONMENTS), np.ones(ENVIRONMENTS, bool)
        for step in range(199):
            observation, rewards, terminated, _, infos = envs.step(act(observation))
            returns += rewards * running
            running &= ~terminated
            if step >= 50:
                errors += [np.abs([infos["position_error"], infos["force_error"]])[:, running]]
        scores += returns.tolist()
    place, force = np.concatenate(errors, axis=1).mean(axis=1)
    print(
        f"{name}: return {shown(np.array(scores))}, off by {1e3 * place:.2f} mm and {force:.2f} N", flush=True
    )
    return np.array(scores)


def shown(values: NDArray[Any]) -> str:
    """Return a mean with its standard error."""
    return f"{values.mean():.1f} +- {values.std() / np.sqrt(len(values)):.1f}"


def main(steps: int) -> None:
    """Print what reflex and policy reach. All of it is simulated."""
    scripted = score("reflex", lambda: touch_reflex)
    model = PPO(
        "MlpPolicy",
        Environments(),
        n_steps=64,
        batch_size=512,
        gamma=0.95,
        gae_lambda=0.9,
        learning_rate=lambda left: 1e-3 * left,
        policy_kwargs={"log_std_init": -1.0},
        seed=1,
        device="cpu",
    )
    model.learn(steps)
    more = score("policy", lambda: policy_of(model)) - scripted
    print(f"more in the same episodes: {shown(more)}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else STEPS)
