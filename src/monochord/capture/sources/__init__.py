"""Where audio comes from: one file a kind of source, found by its name."""

from monochord.capture.sources.base import Source
from monochord.core.registry import Registry

SOURCES: Registry[Source] = Registry("monochord.capture.sources", Source)

__all__ = ["SOURCES"]
