"""Physical models that `simulate` runs: one file a model, the file name is its name."""

from monochord.core.registry import Registry
from monochord.physics.simulators.base import Case, Simulator, Sound

SIMULATORS: Registry[Simulator] = Registry("monochord.physics.simulators", Simulator)

__all__ = ["SIMULATORS", "Case", "Simulator", "Sound"]
