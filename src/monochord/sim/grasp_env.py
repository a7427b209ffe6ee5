"""The Gymnasium environment ``monochord/Grasp-v0``."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.ranges import Seed, checked
from monochord.core.shapes import numbers
from monochord.core.types import Audio, Signal
from monochord.core.units import Newtons
from monochord.live.update import Update
from monochord.perception.model import Model
from monochord.physics.sensors import load_sensor, with_sensor
from monochord.physics.twin.world import World
from monochord.sim.grasp import CAUGHT, END, FIRST_GRIP, HALF_HEIGHT, MAX_GRIP, STRING, Grasp, GraspScene
from monochord.sim.observation import EstimateObserver, ObservationKind, estimates_row, observer

__all__ = ["GraspEnv"]

CHANGE: Newtons = 0.2
"""Change of the grip in a step of 20 ms at an action of 1."""
TOO_HARD = 0.02
"""What a step costs where the grip is twice what holds the object."""
RENDER_MODES = ["rgb_array"]
Observation = dict[str, Audio]


class GraspEnv(gymnasium.Env[Observation, Audio]):
    """Two fingers with a string each hold an object of unknown weight and friction. All simulated.

    ``import monochord.sim`` registers it. `GraspScene` is the scene: the fingers close for 0.6 s, from 1.2 s
    on the table under the object sinks, and an episode ends after 3.6 s, or where the object has left the
    fingers. The action, -1 to 1, changes the grip by up to 0.2 N in a step of 20 ms. A step costs the share
    of 15 mm by which the object sinks in it, and 0.02 times the share by which the grip is more than what
    would hold it.

    The observation is a dictionary: ``touch``, what is observed of both strings, left and right, as in
    ``monochord/Touch-v0``, and ``grip`` in N. ``info`` holds the truth: ``drop`` in m, ``needed`` in N,
    ``caught``.

    Parameters
    ----------
    observation
        ``estimates``, ``sound`` or ``features``.
    world, model, seed
        As of `GraspScene`; `seed` is that of the strings.
    render_mode
        ``rgb_array`` or None. Without a screen set the environment variable ``MUJOCO_GL=egl``.

    Raises
    ------
    InputError
        For a value that is not taken, or a step before a reset.

    Examples
    --------
    >>> import gymnasium
    >>> import monochord.sim
    >>> env = gymnasium.make("monochord/Grasp-v0")
    >>> observation, info = env.reset(seed=1, options={"object": "tube"})
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    >>> observation["touch"].shape, reward <= 0.0, info["caught"]
    ((2, 10), True, True)
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 50}  # noqa: RUF012  (as Gymnasium has it)

    @checked
    def __init__(
        self,
        *,
        observation: ObservationKind = "estimates",
        world: World = "ideal",
        model: str | Model = "demo",
        seed: Seed = 0,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise InputError(f"render_mode {render_mode!r}", f"None or one of {', '.join(RENDER_MODES)}")
        self.render_mode = render_mode
        self._scene = GraspScene(world=world, model=model, seed=seed)
        signal = with_sensor(Signal(sample_rate=44100, channels=2), load_sensor("prototype"))
        self._observer = observer(observation, signal)
        one = self._observer.space
        both = Box(np.stack([one.low] * 2), np.stack([one.high] * 2), dtype=np.float32)
        spaces: Any = Dict(touch=both, grip=Box(0.0, MAX_GRIP, (1,), np.float32))
        self.observation_space = spaces
        self.action_space = Box(-1.0, 1.0, (1,), np.float32)
        self._state: Grasp | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode, with a seed that of `GraspScene.reset`.

        ``options={"object": NAME}`` says which object of `OBJECTS`, else it is drawn.
        """
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(2**31)) if seed is None else seed
        self._state = self._scene.reset(drawn, None if options is None else options.get("object"))
        return self._observation(self._state), self._truth(self._state)

    def step(self, action: Audio) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Change the grip, and hold for 20 ms."""
        before, change = self._state, numbers(action, float, "action")
        if before is None:
            raise InputError("a step before an episode", "reset() first")
        if change.shape != (1,) or not np.isfinite(change).all():
            raise InputError(f"action {action!r:.60}", "one finite number, -1 to 1, in an array")
        grip = before.grip + CHANGE * float(np.clip(change[0], -1.0, 1.0))
        state = self._state = self._scene.step(float(np.clip(grip, FIRST_GRIP, MAX_GRIP)))
        sunk, spare = state.drop - before.drop, state.grip / state.needed - 1.0
        reward = -max(sunk, 0.0) / CAUGHT - TOO_HARD * max(spare, 0.0)
        lost = state.drop > HALF_HEIGHT
        return self._observation(state), reward, lost, state.time >= END - 1e-9, self._truth(state)

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return a picture (480, 640, 3)."""
        return None if self.render_mode is None else self._scene.picture()

    def _observation(self, state: Grasp) -> Observation:
        return {"touch": self._rows(state.updates), "grip": np.array([state.grip], np.float32)}

    def _rows(self, updates: tuple[Update, Update]) -> Audio:
        if isinstance(self._observer, EstimateObserver):
            return np.stack(
                [estimates_row(each.estimates, each.tracked, each.decided, STRING) for each in updates]
            )
        return self._observer.rows([self._observer] * 2, [each.window for each in updates])

    def _truth(self, state: Grasp) -> dict[str, Any]:
        return {
            "object": self._scene.object,
            "drop": state.drop,
            "needed": state.needed,
            "caught": state.caught,
        }
