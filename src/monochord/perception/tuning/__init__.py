"""Pitch, stiffness and losses of a string from its untouched sound, as a fold over windows."""

from monochord.perception.tuning.sessions import retuned_strings, tension_estimator
from monochord.perception.tuning.string_follower import StringFollower
from monochord.perception.tuning.tuner import Tuner, TunerState, Tuning

__all__ = [
    "StringFollower",
    "Tuner",
    "TunerState",
    "Tuning",
    "retuned_strings",
    "tension_estimator",
]
