"""Pitch, stiffness and losses of a string from its untouched sound, as a fold over windows."""

from monochord.perception.tuning.sessions import (
    HIGHEST,
    LOWEST,
    force_scale,
    retuned_strings,
    tension_estimator,
)
from monochord.perception.tuning.tuner import Tuner, TunerState, Tuning

__all__ = [
    "HIGHEST",
    "LOWEST",
    "Tuner",
    "TunerState",
    "Tuning",
    "force_scale",
    "retuned_strings",
    "tension_estimator",
]
