"""Physical models that can be asked for a sound: one file a model, found by its name."""

from monochord.core.registry import Registry
from monochord.physics.simulators.base import Case, Simulator, Sound

SIMULATORS: Registry[Simulator] = Registry("monochord.physics.simulators", Simulator)

__all__ = ["SIMULATORS", "Case", "Simulator", "Sound"]
