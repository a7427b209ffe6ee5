"""Physical models that can be asked for a sound: one file a model, found by its name."""

from monochord.core.registry import Registry
from monochord.physics.simulators.base import Case, Model, Sound

MODELS: Registry[Model] = Registry("monochord.physics.simulators", Model)

__all__ = ["MODELS", "Case", "Model", "Sound"]
