"""A policy for ``monochord/Grasp-v0``, trained by trial, beside the scripted reflex on the same drops.

Needs the extra `policy`; takes some fifteen minutes: ``python -m studies.grasp_policy``.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from stable_baselines3 import PPO
from studies._command import measure

from monochord.benchmarks.base import Benchmark, Row
from monochord.core.types import Audio
from monochord.sim.grasp import OBJECTS, GraspScene, grasp, slip_reflex
from monochord.sim.grasp_env import GraspEnv
from monochord.sim.observation import ESTIMATES

WINDOWS = 3
"""Steps that the policy sees at once."""
SEEN = [ESTIMATES.index(name) for name in ("touched", "slip", "sliding", "force", "force stated")]
ALLOWED = 1.5
"""Largest final grip, in times the least that holds."""


class LatestSteps(gymnasium.ObservationWrapper[Any, Any, Any]):
    """What the strings say of slip and force and what the grip is, in the latest steps."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self._rows: list[Audio] = []
        self.observation_space = Box(-10.0, 10.0, (WINDOWS * (2 * len(SEEN) + 1),), np.float32)

    def reset(self, **options: Any) -> tuple[Audio, dict[str, Any]]:
        """Begin an episode."""
        self._rows = []
        return super().reset(**options)

    def observation(self, observation: dict[str, Audio]) -> Audio:
        """Return the latest rows; at first the first one, repeated."""
        row = np.concatenate([observation["touch"][:, SEEN].ravel(), observation["grip"]])
        self._rows = [*(self._rows or [row] * WINDOWS), row][-WINDOWS:]
        return np.concatenate(self._rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspPolicy(Benchmark):
    """How many drops policy and reflex catch within 15 mm, and how hard they grip.

    Parameters
    ----------
    steps
        Steps of the training, 20 ms each.
    episodes, first
        Number of drops, and the seed of the first; objects take turns. The training draws its own.
    """

    steps: int = 60_000
    episodes: int = 50
    first: int = 2000

    def run(self) -> Iterator[Row]:
        """Train, and run the same drops with both."""
        env = LatestSteps(GraspEnv())
        model = PPO(
            "MlpPolicy",
            env,
            n_steps=1080,
            batch_size=216,
            gamma=0.97,
            gae_lambda=0.9,
            learning_rate=lambda left: 1e-3 * left,
            policy_kwargs={"log_std_init": -1.0},
            seed=1,
            device="cpu",
        )
        model.learn(self.steps)
        names = list(OBJECTS)
        turns = [(seed, names[seed % len(names)]) for seed in range(self.first, self.first + self.episodes)]
        scene = GraspScene()
        reflex = [grasp(scene, slip_reflex(), seed, name) for seed, name in turns]
        yield from _rows("reflex", [(end.caught, end.grip / end.needed) for end in reflex])
        yield from _rows("policy", [_drop(env, model, seed, name) for seed, name in turns])


def _drop(env: LatestSteps, model: PPO, seed: int, name: str) -> tuple[bool, float]:
    """Return whether an object is caught, and the final grip in times the least that holds."""
    seen, info = env.reset(seed=seed, options={"object": name})
    ended = False
    while not ended:
        action, _ = model.predict(seen, deterministic=True)
        seen, _, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
    return bool(info["caught"]), float(seen[-1]) / info["needed"]


def _rows(name: str, ends: list[tuple[bool, float]]) -> Iterator[Row]:
    caught = [grip for is_caught, grip in ends if is_caught]
    yield Row(name=f"{name}: caught within 15 mm", value=len(caught), unit="1")
    if caught:
        yield Row(
            name=f"{name}: caught, grip at most {ALLOWED:g}",
            value=sum(grip <= ALLOWED for grip in caught),
            unit="1",
        )
        yield Row(name=f"{name}: median final grip over needed", value=float(np.median(caught)), unit="1")


if __name__ == "__main__":
    measure(GraspPolicy)
