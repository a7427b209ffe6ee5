"""Where predictions go: one file a kind of sink, found by its name."""

from monochord.registry import Registry
from monochord.sinks.base import Sink

SINKS: Registry[Sink] = Registry("monochord.sinks", Sink)

__all__ = ["SINKS"]
