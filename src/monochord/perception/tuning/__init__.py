"""The string's own pitch, stiffness and losses from untouched sound, as a fold over windows."""

from monochord.perception.tuning.tuner import Tuner, TunerState, Tuning

__all__ = ["Tuner", "TunerState", "Tuning"]
