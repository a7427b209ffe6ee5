"""Simulators that `simulate` runs: one module per model, found by name."""

from monochord.core.registry import Registry
from monochord.physics.simulators.base import Case, Simulator, Sound

SIMULATORS: Registry[Simulator] = Registry("monochord.physics.simulators", Simulator)

__all__ = ["SIMULATORS", "Case", "Simulator", "Sound"]
