"""What is read off a window before anything is learned: one file a kind of feature, found by its name."""

from monochord.features.base import Feature
from monochord.registry import Registry

FEATURES: Registry[Feature] = Registry("monochord.features", Feature)

__all__ = ["FEATURES"]
