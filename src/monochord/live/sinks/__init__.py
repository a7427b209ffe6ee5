"""Where predictions go: one file a kind of sink, found by its name."""

from monochord.core.registry import Registry
from monochord.live.sinks.base import Sink

SINKS: Registry[Sink] = Registry("monochord.live.sinks", Sink)

__all__ = ["SINKS"]
