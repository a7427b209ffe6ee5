"""The learned estimator: contact, slip, position and force by a trained model."""

from dataclasses import dataclass
from pathlib import Path

from monochord.core.errors import InputError
from monochord.core.types import Estimate, Estimates, Prepared, Signal, Window
from monochord.core.units import Samples
from monochord.perception.closed_form.spectrum import SpectrumAnalyser
from monochord.perception.closed_form.two_segments import MIN_LEAD
from monochord.perception.closed_form.usable import why_unusable
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import Model, ModelState, load
from monochord.perception.tuning import OwnString, TunerState
from monochord.perception.tuning.sessions import HIGHEST, LOWEST
from monochord.physics.theory import open_frequency

PRESS_RISE = 0.01
"""Share by which a press may raise the open frequency: 2 N at the middle of the prototype do."""
KNOWN = "what this model knows"


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelEstimator(Estimator):
    """A model that ``monochord train`` trained, on one stream of windows in order.

    A window that does not begin after the one before it begins another stream. Features are relative to the
    string as the signal's sensor is tuned. Where the string sounds otherwise, the model abstains and says by
    how much; what untouched windows say counts, and before any a reading at another tuning.

    Parameters
    ----------
    path
        Folder of a model or of the training run that made it, or the name of a bundled one: demo.
    """

    path: Path

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Load the model for the string as it is tuned, and check that it fits the signal."""
        model, state = load(self.path), ModelState()
        model = model.tuned(signal.string) if signal.string else model
        model.check(signal, size)
        watch, tuner = _Watch.of(model, size), TunerState()
        heads = model.definition.heads.items()
        of_a_touch = [name for name, record in heads if record.task.touched]

        def estimate(window: Window) -> Estimates:
            nonlocal state, tuner
            state, estimates = model.predict(state, window)
            if watch is None:
                return estimates
            tuner = watch.own.step(tuner, window)
            why_not = watch.why_detuned(tuner, window)
            if why_not:
                return {name: Estimate.abstain(each.unit, why_not) for name, each in estimates.items()}
            if watch.is_undecided(window):
                return {
                    **estimates,
                    **{name: Estimate.abstain(estimates[name].unit, "two candidates") for name in of_a_touch},
                }
            return estimates

        return estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class _Watch:
    """Watches whether the string sounds as the model knows it: by untouched windows, else by the window."""

    own: OwnString
    analyser: SpectrumAnalyser
    is_retuned: bool

    @classmethod
    def of(cls, model: Model, size: Samples) -> "_Watch | None":
        """Return it, or None for a model of no string, or of one that cannot be followed."""
        trained, string = model.definition, model.string or model.definition.string
        signal = Signal(sample_rate=trained.sample_rate, channels=trained.channels, string=string)
        if string is None or trained.channels != 2:
            return None
        try:
            own = OwnString.of(signal, size, lowest=LOWEST, highest=HIGHEST)
            analyser = SpectrumAnalyser.of(signal, size)
            known = string if trained.string is None else trained.string
            off = open_frequency(string) / open_frequency(known) - 1.0
            return cls(own=own, analyser=analyser, is_retuned=not LOWEST <= off <= HIGHEST)
        except InputError:
            return None

    def why_detuned(self, state: TunerState, window: Window) -> str:
        """Return why a model should abstain, empty where it should not."""
        if state.tuning is not None:
            return self.own.why_detuned(state.tuning, KNOWN)
        if why_unusable(window):
            return ""
        return self.own.why_elsewhere(self.analyser, self.analyser.analyse(window.samples), KNOWN)

    def is_undecided(self, window: Window) -> bool:
        """Return whether a touch has two places that read alike, on a string tuned beyond the training.

        There drivers lock to other modes, and a model has not learned which of the two is right.
        """
        if not self.is_retuned or why_unusable(window):
            return False
        spectrum = self.analyser.analyse(window.samples)
        reading = self.analyser.read_at_any_tuning(spectrum, PRESS_RISE)
        return reading.touched and reading.contact_lead > 0.0 and reading.lead < MIN_LEAD
