"""What is estimated from a feature: one file a head, found by its name."""

from monochord.core.registry import Registry
from monochord.perception.heads.base import Head

HEADS: Registry[Head] = Registry("monochord.perception.heads", Head)

__all__ = ["HEADS"]
