"""The string's own pitch, stiffness and losses from untouched sound, as a fold over windows."""

from monochord.perception.tuning.own_string import OwnString
from monochord.perception.tuning.sessions import own_strings, tension_estimator
from monochord.perception.tuning.tuner import Tuner, TunerState, Tuning

__all__ = [
    "OwnString",
    "Tuner",
    "TunerState",
    "Tuning",
    "own_strings",
    "tension_estimator",
]
