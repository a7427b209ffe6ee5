"""The string as it is tuned now: what is known of it, and whether it sounds as it should."""

from dataclasses import dataclass

from monochord.core.types import Signal, StringParams, Window
from monochord.core.units import Samples
from monochord.perception.closed_form.spectrum import Spectrum, SpectrumAnalyser
from monochord.perception.tuning.reading import RANGE
from monochord.perception.tuning.tuner import Tuner, TunerState, Tuning

MIN_RETUNING = 0.005
"""Least share off the known tuning that is followed. Drivers pull what they sustain by half of that."""
MIN_ADVANTAGE = 0.12
"""Lead in score of a reading at another tuning over the one at the known tuning, from which it counts.

On the twin of four presets, 1,700 windows within 2 % of nominal have 0.07 at most; of wrong readings of a
detuned string of two drivers all have 0.19 or more."""
MIN_LINES = 5
"""Fewest lines, counted at each microphone, of such a reading where the known tuning has one too: two lines
fit any tuning with some modes."""
REMEDY = "run monochord tune"


@dataclass(frozen=True, slots=True, kw_only=True)
class StringFollower:
    """Follows a string's tuning through the windows of a stream, and judges whether it is the known one.

    What untouched windows say counts most. Before the first of them, a touched one is read at any tuning too:
    a reading elsewhere that explains it clearly better says that the string is tuned so.

    Parameters
    ----------
    string
        The string as it is known: of the design, or as tuned.
    tuner
        For windows of that string.
    lowest, highest
        Shares by which the open frequency may lie off the known one, below (negative) and above.
    """

    string: StringParams
    tuner: Tuner
    lowest: float = -MIN_RETUNING
    highest: float = MIN_RETUNING

    @classmethod
    def of(
        cls, signal: Signal, size: Samples, *, lowest: float = -MIN_RETUNING, highest: float = MIN_RETUNING
    ) -> "StringFollower":
        """Return it for windows of `size` frames; raises `InputError` as `Tuner.of` does."""
        tuner = Tuner.of(signal, size)
        return cls(string=tuner.string, tuner=tuner, lowest=lowest, highest=highest)

    def step(self, state: TunerState, window: Window) -> TunerState:
        """Return the tuner's state after one more window."""
        return self.tuner.step(state, window)

    def retuned(self, tuning: Tuning | None) -> StringParams:
        """Return the string at its own pitch; the known one where that is not known to differ."""
        if tuning is None or not self.deviates(tuning):
            return self.string
        return tuning.tuned(self.string)

    def deviates(self, tuning: Tuning) -> bool:
        """Return whether a tuning is outside the allowed range."""
        return not self.lowest <= tuning.deviation(self.string) <= self.highest

    def detuned_reason(self, tuning: Tuning | None, knows: str) -> str:
        """Return why the string is not as it should be, empty where it is or that is not known.

        `knows` is who expects it otherwise, for the message, such as "what this model knows".
        """
        if tuning is None or not self.deviates(tuning):
            return ""
        return detuned(tuning.deviation(self.string), knows)

    def other_tuning_reason(self, analyser: SpectrumAnalyser, spectrum: Spectrum, knows: str) -> str:
        """Return why a window is one of a string tuned otherwise; empty where it is not clearly so."""
        own = spectrum.reading
        other = analyser.read_at_any_tuning(spectrum, RANGE)
        off = other.open_frequency / analyser.nominal - 1.0
        best = max(own.score, own.untouched_score)
        leads = other.score >= max(best, 0.0) + MIN_ADVANTAGE and other.uneven
        if leads and (other.lines >= MIN_LINES or best < 0.0) and not self.lowest <= off <= self.highest:
            return detuned(off, knows)
        return ""


def detuned(deviation: float, knows: str) -> str:
    """Return the reason for abstaining on a string that is off by a share.

    >>> detuned(-0.0412, "what this model knows")
    'the string sounds 4.1 % below what this model knows: run monochord tune'
    """
    side = "below" if deviation < 0.0 else "above"
    return f"the string sounds {100.0 * abs(deviation):.1f} % {side} {knows}: {REMEDY}"
