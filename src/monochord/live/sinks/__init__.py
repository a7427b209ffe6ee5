"""Sinks, which take the live predictions: one module per kind, found by name."""

from monochord.core.registry import Registry
from monochord.live.sinks.base import Sink

SINKS: Registry[Sink] = Registry("monochord.live.sinks", Sink)

__all__ = ["SINKS"]
