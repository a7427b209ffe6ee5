"""Audio sources: one module per kind, found by name."""

from monochord.capture.sources.base import Source
from monochord.core.registry import Registry

SOURCES: Registry[Source] = Registry("monochord.capture.sources", Source)

__all__ = ["SOURCES"]
