"""Where audio comes from: one file a kind of source, found by its name."""

from monochord.registry import Registry
from monochord.sources.base import Source

SOURCES: Registry[Source] = Registry("monochord.sources", Source)

__all__ = ["SOURCES"]
