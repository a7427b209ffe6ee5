"""What is read off a window before anything is learned: one file a kind of feature, found by its name."""

from monochord.core.registry import Registry
from monochord.perception.features.base import Feature

FEATURES: Registry[Feature] = Registry("monochord.perception.features", Feature)

__all__ = ["FEATURES"]
