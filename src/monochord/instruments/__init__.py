"""What is recorded beside audio, force/torque and pose: one file a kind of instrument, found by its name."""

from monochord.instruments.base import Instrument
from monochord.registry import Registry

INSTRUMENTS: Registry[Instrument] = Registry("monochord.instruments", Instrument)

__all__ = ["INSTRUMENTS"]
