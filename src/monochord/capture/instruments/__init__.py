"""What is recorded beside audio, force/torque and pose: one file a kind of instrument, found by its name."""

from monochord.capture.instruments.base import Instrument
from monochord.core.registry import Registry

INSTRUMENTS: Registry[Instrument] = Registry("monochord.capture.instruments", Instrument)

__all__ = ["INSTRUMENTS"]
