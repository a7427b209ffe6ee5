"""What is read from a feature: one file a head, found by its name."""

from monochord.heads.base import Head
from monochord.registry import Registry

HEADS: Registry[Head] = Registry("monochord.heads", Head)

__all__ = ["HEADS"]
