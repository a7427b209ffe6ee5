"""The string's own pitch, followed while it runs."""

from dataclasses import dataclass, replace
from math import isfinite

from monochord.core.types import Estimate, Estimates, Prepared, Signal, StringParams, Window
from monochord.core.units import Samples, Seconds
from monochord.perception.estimators.base import Estimator
from monochord.perception.tuning import Tuner, TunerState

UNITS = {"frequency": "Hz", "tension": "N", "inharmonicity": "", "decay": "1/s"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning(Estimator):
    """Pitch, tension, stiffness and losses of the string from the windows in which nothing touches it.

    Estimates ``frequency`` f0 = sqrt(T / mu) / (2 L) in Hz, the ``tension`` in N that follows, the
    ``inharmonicity`` B, and the rate ``decay`` in 1/s at which free partials die away. While the string is
    touched they are those of before. A window that does not begin after the one before begins anew.

    Parameters
    ----------
    keep
        How many windows of untouched sound count, the newest.
    every
        Least distance of their starts in s.
    """

    keep: int = 40
    every: Seconds = 0.1

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Return the function from a window to the estimates; the signal's string is the nominal one."""
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
        return {name: Estimate.abstain(unit, state.why_not) for name, unit in UNITS.items()}
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
        else Estimate.abstain(UNITS[name], "no free partial is seen to die away")
        for name, (value, std) in values.items()
    }
