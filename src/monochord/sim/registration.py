"""The names of the Gymnasium environments."""

from gymnasium.envs import registration

__all__ = ["register"]

EPISODE_STEPS = 200
"""Steps of an episode; at the default hop 4 s."""


def register() -> None:
    """Register the environments with Gymnasium, unless they are."""
    if "monochord/Touch-v0" not in registration.registry:
        registration.register(
            id="monochord/Touch-v0",
            entry_point="monochord.sim.touch_env:TouchEnv",
            vector_entry_point="monochord.sim.touch_env:TouchVectorEnv",
            max_episode_steps=EPISODE_STEPS,
        )
    if "monochord/Grasp-v0" not in registration.registry:
        registration.register(id="monochord/Grasp-v0", entry_point="monochord.sim.grasp_env:GraspEnv")
