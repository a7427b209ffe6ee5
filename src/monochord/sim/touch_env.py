"""The Gymnasium environment ``monochord/Touch-v0``, alone and as many at once."""

from collections.abc import Iterable
from operator import index
from typing import Any, SupportsIndex

import gymnasium
import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.ranges import Count, checked
from monochord.core.types import Audio, Flags, Floats
from monochord.sim.observation import EstimateObserver
from monochord.sim.touch_picture import touch_picture
from monochord.sim.touch_task import Fingertips, TouchSettings

__all__ = ["TouchEnv", "TouchVectorEnv"]

NAME = "monochord/Touch-v0"
RENDER_MODES = ["rgb_array"]
Observation = dict[str, Audio]


class TouchEnv(gymnasium.Env[Any, Audio]):
    """A fingertip finds a string, holds a force, or follows a goal, by the string's sound. All simulated.

    ``import monochord.sim`` registers it; `gymnasium.make` ends its episodes after 200 steps, 4 s. Spaces are
    those of `monochord.sim.touch_task.Fingertips`, and settings those of `TouchSettings`. An episode draws
    the string's height and build, the fingertip's stiffness and place, and the goal. It begins with an
    untouched string that has sounded for 0.6 s, always the same sound of a build. A force of 5 N ends it.

    ``info`` holds the truth: ``contact``, ``position``, ``force``, ``position_error``, ``force_error``.

    Raises
    ------
    InputError
        For an unknown setting, or a value that it does not take.

    Examples
    --------
    >>> import gymnasium
    >>> import monochord.sim
    >>> env = gymnasium.make("monochord/Touch-v0", task="find", render_mode="rgb_array")
    >>> observation, info = env.reset(seed=1)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    >>> observation["touch"].shape, reward, terminated, env.render().shape
    ((10,), 0.0, False, (160, 480, 3))
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 50}  # noqa: RUF012  (as Gymnasium has it)

    def __init__(self, render_mode: str | None = None, **settings: Any) -> None:
        self.render_mode = _render_mode(render_mode)
        self._fingertips = Fingertips(1, _settings(settings))
        self.action_space = self._fingertips.action_space
        self.observation_space = self._fingertips.observation_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode, and return its first observation."""
        super().reset(seed=seed, options=options)
        self._fingertips.begin(0, self.np_random)
        return self._observation(), {}

    def step(self, action: Audio) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Move for one hop."""
        rewards, overloaded = self._fingertips.step(np.asarray(action)[np.newaxis])
        return (
            self._observation(),
            float(rewards[0]),
            bool(overloaded[0]),
            False,
            dict(self._fingertips.truth[0]),
        )

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return a picture (160, 480, 3)."""
        return None if self.render_mode is None else _picture(self._fingertips, 0)

    def _observation(self) -> Observation:
        return {name: rows[0] for name, rows in self._fingertips.observation().items()}


class TouchVectorEnv(VectorEnv[Observation, Audio, NDArray[Any]]):
    """Many `TouchEnv` that step together: strings advance on all cores, and a model reads them as a batch.

    Environment i gives what a `TouchEnv` with seed + i gives, to the last bit.

    Parameters
    ----------
    num_envs
        Number of environments.
    max_episode_steps
        Steps after which an episode is truncated.
    autoreset_mode
        ``NextStep``: the step after an episode's end begins the next one, and ignores its action.
        ``SameStep``: the last step returns the next episode's first observation, and the last one in
        ``infos["final_obs"]``, with ``infos["final_info"]``.
    settings
        Those of `TouchSettings`.

    Examples
    --------
    >>> import gymnasium
    >>> import monochord.sim
    >>> envs = gymnasium.make_vec(
    ...     "monochord/Touch-v0", num_envs=2, vectorization_mode="vector_entry_point", observation="sound"
    ... )
    >>> observations, infos = envs.reset(seed=1)
    >>> observations, rewards, *_ = envs.step(envs.action_space.sample())
    >>> observations["touch"].shape, rewards.shape
    ((2, 2, 4410), (2,))
    """

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES, "render_fps": 50}  # noqa: RUF012

    @checked
    def __init__(
        self,
        num_envs: Count = 1,
        *,
        max_episode_steps: Count | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        self.render_mode, self.num_envs = _render_mode(render_mode), num_envs
        self._max_steps, self._mode = max_episode_steps, _autoreset_mode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self._mode}
        self._fingertips = Fingertips(num_envs, _settings(settings))
        self.single_action_space = self._fingertips.action_space
        self.single_observation_space = self._fingertips.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._generators: list[np.random.Generator] = []
        self._steps, self._ended = np.zeros(num_envs, int), np.zeros(num_envs, bool)

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,  # noqa: ARG002  (none are known)
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode in every environment, and return the first observations.

        A whole `seed` is that of the first one, and each next one has the next number.
        """
        seeds = [seed] * self.num_envs if seed is None else seed
        if isinstance(seeds, SupportsIndex):
            seeds = [index(seeds) + number for number in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise InputError(
                f"{len(seeds)} seeds", f"{self.num_envs}, one of each environment, or one number"
            )
        before = self._generators or [None] * self.num_envs
        self._generators = [
            generator if generator is not None and each is None else np_random(each)[0]
            for generator, each in zip(before, seeds, strict=True)
        ]
        self._begin(range(self.num_envs))
        return self._fingertips.observation(), {}

    def step(self, actions: Audio) -> tuple[Observation, Floats, Flags, Flags, dict[str, Any]]:
        """Move all for one hop."""
        ended = np.flatnonzero(self._ended).tolist()
        self._begin(ended)
        moving = sorted({*range(self.num_envs)} - {*ended})
        rewards, terminated = self._fingertips.step(actions, moving)
        self._steps[moving] += 1
        late = self._max_steps is not None and self._steps >= self._max_steps
        truncated = np.broadcast_to(late, self.num_envs).copy()
        self._ended = terminated | truncated
        observations = self._fingertips.observation()
        if self._mode is not AutoresetMode.SAME_STEP:
            return observations, rewards, terminated, truncated, self._truth(moving)
        over = np.flatnonzero(self._ended).tolist()
        infos = self._truth([number for number in moving if number not in over])
        for number in over:
            final = {"final_obs": {name: rows[number] for name, rows in observations.items()}}
            infos = self._add_info(
                infos, {**final, "final_info": dict(self._fingertips.truth[number])}, number
            )
        self._begin(over)
        return self._fingertips.observation() if over else observations, rewards, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a picture (160, 480, 3) of each."""
        if self.render_mode is None:
            return None
        return tuple(_picture(self._fingertips, number) for number in range(self.num_envs))

    def _begin(self, chosen: Iterable[int]) -> None:
        for number in chosen:
            self._fingertips.begin(number, self._generators[number])
            self._steps[number], self._ended[number] = 0, False

    def _truth(self, chosen: Iterable[int]) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for number in chosen:
            infos = self._add_info(infos, self._fingertips.truth[number], number)
        return infos


def _settings(given: dict[str, Any]) -> TouchSettings:
    return from_tree(TouchSettings, given, NAME)


def _render_mode(given: str | None) -> str | None:
    if given not in (None, *RENDER_MODES):
        raise InputError(f"render_mode {given!r}", f"None or one of {', '.join(RENDER_MODES)}")
    return given


def _autoreset_mode(given: AutoresetMode | str) -> AutoresetMode:
    taken = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP
    for mode in taken:
        if given in (mode, mode.value):
            return mode
    raise InputError(f"autoreset_mode {given!r}", " or ".join(mode.value for mode in taken))


def _picture(fingertips: Fingertips, number: int) -> NDArray[np.uint8]:
    """Return the picture of a fingertip, with what is estimated of it."""
    truth, watching = fingertips.truth[number], fingertips.observer(number)
    place = watching.tracked.estimates.get("position") if isinstance(watching, EstimateObserver) else None
    goal_place, goal_force = fingertips.goal()[number].tolist()
    return touch_picture(
        length=float(fingertips.length[number]),
        place=float(fingertips.place[number]),
        height=fingertips.height(number),
        force=truth.get("force", 0.0),
        goal=(goal_place, goal_force),
        told=(place.value, place.std) if place is not None and place.valid else None,
    )
