"""The present tuning of a string, and whether it deviates from the expected one."""

from dataclasses import dataclass

from monochord.core.types import Signal, StringParams, Window
from monochord.core.units import Samples
from monochord.perception.tuning.tuner import Tuner, TunerState, Tuning

MIN_RETUNING = 0.005
"""Smallest relative deviation from the expected tuning that is followed. Drivers shift what they sustain by
half of it."""
REMEDY = "run monochord tune"


@dataclass(frozen=True, slots=True, kw_only=True)
class StringFollower:
    """Follows a string's tuning through a stream of windows, and compares it with the expected tuning.

    Untouched windows measure the tuning.

    Parameters
    ----------
    string
        The string at its expected tuning: the design's, or the measured one of a tuned sensor.
    tuner
        The tuner for windows of this string.
    lowest, highest
        Relative deviations of the open frequency that are not followed: down to `lowest` (negative), up to
        `highest`.
    """

    string: StringParams
    tuner: Tuner
    lowest: float = -MIN_RETUNING
    highest: float = MIN_RETUNING

    @classmethod
    def of(
        cls, signal: Signal, size: Samples, *, lowest: float = -MIN_RETUNING, highest: float = MIN_RETUNING
    ) -> "StringFollower":
        """Return the follower for windows of `size` frames; raises `InputError` as `Tuner.of` does."""
        tuner = Tuner.of(signal, size)
        return cls(string=tuner.string, tuner=tuner, lowest=lowest, highest=highest)

    def step(self, state: TunerState, window: Window) -> TunerState:
        """Return the tuner's state after one more window."""
        return self.tuner.step(state, window)

    def retuned(self, tuning: Tuning | None) -> StringParams:
        """Return the string at the measured tuning if it deviates, else at the expected tuning."""
        if tuning is None or not self.deviates(tuning):
            return self.string
        return tuning.tuned(self.string)

    def deviates(self, tuning: Tuning) -> bool:
        """Return whether a tuning deviates from the expected one by more than the range allows."""
        return not self.lowest <= tuning.deviation(self.string) <= self.highest

    def detuned_reason(self, tuning: Tuning | None, expected: str) -> str:
        """Return the reason for abstaining if a tuning deviates; empty without a deviation or a tuning.

        `expected` describes the expected pitch in the reason, such as "its known pitch".
        """
        if tuning is None or not self.deviates(tuning):
            return ""
        return detuned(tuning.deviation(self.string), expected)


def detuned(deviation: float, expected: str) -> str:
    """Return the reason for abstaining on a string whose pitch deviates by a share from the expected one.

    >>> detuned(-0.0412, "its known pitch")
    'the string sounds 4.1 % below its known pitch: run monochord tune'
    """
    side = "below" if deviation < 0.0 else "above"
    return f"the string sounds {100.0 * abs(deviation):.1f} % {side} {expected}: {REMEDY}"
