"""Heads: the quantities that a model estimates from a feature, one file each, found by name."""

from monochord.core.registry import Registry
from monochord.perception.heads.base import Head

HEADS: Registry[Head] = Registry("monochord.perception.heads", Head)

__all__ = ["HEADS"]
