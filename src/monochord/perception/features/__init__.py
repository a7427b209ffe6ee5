"""Features of a window, one file each, found by name."""

from monochord.core.registry import Registry
from monochord.perception import MOVED
from monochord.perception.features.base import Feature

FEATURES: Registry[Feature] = Registry("monochord.perception.features", Feature, MOVED)

__all__ = ["FEATURES"]
