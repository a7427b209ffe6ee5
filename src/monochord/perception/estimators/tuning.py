"""The tuning of the string, followed live."""

from dataclasses import dataclass, replace
from math import isfinite

from monochord.core.reasons import Reason
from monochord.core.types import Estimate, Estimates, Prepared, Signal, StringParams, Window
from monochord.core.units import Samples, Seconds
from monochord.perception.estimators.base import Estimator
from monochord.perception.tuning import Tuner, TunerState

UNITS = {"frequency": "Hz", "tension": "N", "inharmonicity": "", "decay": "1/s"}


@dataclass(frozen=True, slots=True, kw_only=True)
class TuningEstimator(Estimator):
    """Pitch, tension, stiffness and losses of the string, from its untouched windows.

    The estimates are ``frequency`` f0 = sqrt(T / mu) / (2 L) in Hz, the ``tension`` T in N, the
    ``inharmonicity`` B, and the ``decay`` rate of free partials in 1/s. They keep their values while the
    string is touched. A window that starts no later than its predecessor begins a new stream.

    Parameters
    ----------
    keep
        Number of untouched windows that count; the newest are kept.
    every
        Smallest time between the starts of two such windows, in s.
    """

    keep: int = 40
    every: Seconds = 0.1

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Return the function from a window to the estimates; the signal's string is nominal."""
        tuner = replace(Tuner.of(signal, size), keep=self.keep, every=self.every)
        string, state = tuner.string, TunerState()

        def estimate(window: Window) -> Estimates:
            nonlocal state
            state = tuner.step(state, window)
            return _estimates(state, string)

        return estimate


def _estimates(state: TunerState, string: StringParams) -> Estimates:
    tuning = state.tuning
    if tuning is None:
        return {name: Estimate.abstain(unit, state.reason) for name, unit in UNITS.items()}
    tension, tension_std = tuning.tension(string)
    values = {
        "frequency": (tuning.frequency, tuning.frequency_std),
        "tension": (tension, tension_std),
        "inharmonicity": (tuning.inharmonicity, tuning.inharmonicity_std),
        "decay": (tuning.decay, tuning.decay_std),
    }
    return {
        name: Estimate(value=value, std=std, unit=UNITS[name])
        if isfinite(value)
        else Estimate.abstain(UNITS[name], Reason.NO_DECAY)
        for name, (value, std) in values.items()
    }
