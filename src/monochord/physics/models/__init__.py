"""Physical models that can be asked for a sound: one file a model, found by its name."""

from monochord.physics.models.base import Case, Model, Sound
from monochord.registry import Registry

MODELS: Registry[Model] = Registry("monochord.physics.models", Model)

__all__ = ["MODELS", "Case", "Model", "Sound"]
