"""Computing time of the environment Touch-v0: a reset, a step, and many environments at once.

Prints its table in some two minutes: ``python -m studies.touch_env``. Processor time, so that other programs
on the machine matter little.
"""

import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.utils.env_checker import check_env
from studies._command import measure

from monochord.benchmarks.base import Benchmark, Row, row
from monochord.core.ranges import Checked, Count
from monochord.core.types import Audio
from monochord.sim.touch_env import TouchEnv, TouchVectorEnv

RESET, STEP, RATE = "reset <= ms", "step <= ms", "steps a second and core >="
AIMS = {"estimates": {RESET: 3.0, STEP: 2.5, RATE: 450.0}, "sound": {RESET: 3.0, STEP: 1.0, RATE: 1200.0}}


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch(Benchmark):
    """Processor time of Touch-v0 by observation and world, beside what was aimed at.

    A fingertip comes down and slides to and fro. `check_env` of Gymnasium runs first; a warning ends the run.

    Parameters
    ----------
    observations, worlds
        What is measured.
    steps
        Steps of one environment, and resets.
    environments
        Number of environments at once.
    """

    observations: tuple[str, ...] = ("estimates", "sound", "features")
    worlds: tuple[str, ...] = ("ideal", "plausible")
    steps: Count = 400
    environments: Count = 32

    def __post_init__(self) -> None:
        Checked.__post_init__(self)

    def run(self) -> Iterator[Row]:
        """Measure each observation in each world."""
        for observation in self.observations:
            for world in self.worlds:
                settings: dict[str, Any] = {"observation": observation, "world": world, "builds": 4}
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    check_env(TouchEnv(**settings), skip_render_check=True)
                name, aims = f"{observation}, {world}", AIMS.get(observation, {})
                reset, step = self._alone(TouchEnv(**settings))
                yield _row(f"{name}, reset", reset, "ms", RESET, aims)
                yield _row(f"{name}, step of 20 ms", step, "ms", STEP, aims)
                rate = self._together(TouchVectorEnv(self.environments, **settings))
                yield _row(f"{name}, {self.environments} at once", rate, "steps/s and core", RATE, aims)

    def _alone(self, env: TouchEnv) -> tuple[float, float]:
        """Return the processor time of a reset and of a step, in ms."""
        for seed in range(32):  # every build has been drawn
            env.reset(seed=seed)
        reset = _time(lambda: [env.reset() for _ in range(self.steps)])
        actions = _actions(self.steps)
        step = _time(lambda: [env.step(action) for action in actions])
        return 1e3 * reset / self.steps, 1e3 * step / self.steps

    def _together(self, envs: TouchVectorEnv) -> float:
        """Return how many environments step in a second of processor time."""
        envs.reset(seed=1)
        steps = max(self.steps // 10, 1)
        actions = [np.tile(action, (self.environments, 1)) for action in _actions(steps)]
        done = _time(lambda: [envs.step(each) for each in actions])
        return steps * self.environments / done


def _actions(steps: int) -> Audio:
    """Return the actions (steps, 2) of a fingertip that comes down by 2 mm, and slides to and fro."""
    number = np.arange(steps)
    return np.stack([np.sin(number / 9.0), number < 5], axis=1).astype(np.float32)


def _time(work: Callable[[], object]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


def _row(name: str, value: float, unit: str, aim: str, aims: dict[str, float]) -> Row:
    return row(name, value, unit, aim, aims[aim]) if aims else row(name, value, unit)


if __name__ == "__main__":
    measure(Touch)
