"""Pitch, stiffness and losses of a string from its untouched sound, as a fold over windows."""

from monochord.perception.tuning.sessions import retuned_strings, tension_estimator
from monochord.perception.tuning.tuner import Tuner, TunerState, Tuning

__all__ = [
    "Tuner",
    "TunerState",
    "Tuning",
    "retuned_strings",
    "tension_estimator",
]
