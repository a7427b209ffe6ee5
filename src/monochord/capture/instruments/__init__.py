"""Instruments recorded beside audio, such as force/torque and pose: one module per kind, found by name."""

from monochord.capture.instruments.base import Instrument
from monochord.core.registry import Registry

INSTRUMENTS: Registry[Instrument] = Registry("monochord.capture.instruments", Instrument)

__all__ = ["INSTRUMENTS"]
