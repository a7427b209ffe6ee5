"""The scripted baseline of ``monochord/Touch-v0``: come down, then follow the estimates."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from monochord.core.types import Audio
from monochord.sim.observation import ESTIMATES

__all__ = ["touch_reflex"]

APPROACH = 1.0
"""Speed down until a touch is decided, as an action: 2 cm/s."""
PLACE_GAIN, FORCE_GAIN = 80.0, 0.2
"""Action by place error in lengths of the string, and by force error in N. Of a grid with gains of 20 to 120
and 0.1 to 0.35 and approaches of 0.3 to 1, these score best over all three tasks, on `plausible` builds."""
_TOUCHED, _PLACE, _PLACED, _FORCE, _FORCED = (
    ESTIMATES.index(name) for name in ("touched", "position", "position stated", "force", "force stated")
)


def touch_reflex(observation: Mapping[str, Any]) -> Audio:
    """Return the action (2,) for an observation, or (n, 2) for n, with ``observation="estimates"``.

    Where an estimate is withheld under a touch, the fingertip waits.

    Examples
    --------
    >>> import gymnasium
    >>> import monochord.sim
    >>> env = gymnasium.make("monochord/Touch-v0", task="hold")
    >>> observation, _ = env.reset(seed=1)
    >>> for _ in range(100):
    ...     observation, reward, *_ = env.step(touch_reflex(observation))
    >>> reward > 0.5
    True
    """
    touch, goal = np.asarray(observation["touch"]), np.asarray(observation["goal"])
    touched = touch[..., _TOUCHED] > 0.5
    along = touch[..., _PLACED] * PLACE_GAIN * (goal[..., 0] - touch[..., _PLACE])
    press = touch[..., _FORCED] * FORCE_GAIN * (goal[..., 1] - touch[..., _FORCE])
    action = np.stack([np.where(touched, along, 0.0), np.where(touched, press, APPROACH)], axis=-1)
    return np.clip(action, -1.0, 1.0).astype(np.float32)
