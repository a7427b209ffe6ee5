"""The learned estimator: contact, slip, position and force by a trained model."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from monochord.core.errors import InputError
from monochord.core.types import Estimate, Estimates, Prepared, Signal, StringParams, Window
from monochord.core.units import Samples
from monochord.perception.closed_form.spectrum import SpectrumAnalyser
from monochord.perception.closed_form.two_segments import MIN_SCORE
from monochord.perception.closed_form.usable import why_unusable
from monochord.perception.estimators.base import Condition, Estimator, Watching
from monochord.perception.model import Model, ModelState, load
from monochord.perception.tuning import OwnString, TunerState, Tuning
from monochord.perception.tuning.sessions import HIGHEST, LOWEST

KNOWN = "what this model knows"
UNKNOWN = "the string's pitch is not known yet"
"""Of the first untouched windows where they are none of the known string's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelEstimator(Estimator):
    """A model that ``monochord train`` trained, on one stream of windows in order.

    A window that does not begin after the one before it begins another stream. Features are relative to the
    string as the signal's sensor is tuned. Where untouched windows show that it is tuned otherwise by now,
    features follow, as in training. Before the first of them, a touched one of a string that is tuned
    otherwise is abstained from, with by how much it is off.

    Parameters
    ----------
    path
        Folder of a model or of the training run that made it, or the name of a bundled one: demo.
    """

    path: Path

    @property
    def model(self) -> str:
        """The folder or name."""
        return str(self.path)

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Load the model for the string as it is tuned, and check that it fits the signal."""
        model = load(self.path)
        model = model.tuned(signal.string) if signal.string else model
        model = model.within(signal.sensing_range) if signal.sensing_range else model
        model.check(signal, size)
        string = model.string or model.definition.string
        if string is not None and model.definition.channels == 2:
            own = Signal(sample_rate=signal.sample_rate, channels=2, string=string)
            try:
                return _Followed(model, own, size)
            except InputError:  # windows too short for a pitch
                pass
        return _Fixed(model)

    def estimate_all(self, prepared: Sequence[Prepared], windows: Sequence[Window]) -> list[Estimates]:
        """Return the estimates of windows of several strings; the heads are computed for all at once."""
        streams = [each for each in prepared if isinstance(each, _Stream)]
        if len(streams) != len(prepared) or len(streams) < 2:
            return Estimator.estimate_all(self, prepared, windows)
        before = [stream.before(window) for stream, window in zip(streams, windows, strict=True)]
        predicted = zip(streams, windows, Model.predict_all(before, windows), strict=True)
        return [stream.after(window, state, estimates) for stream, window, (state, estimates) in predicted]


class _Stream(ABC):
    """A model on one stream of windows."""

    def __call__(self, window: Window) -> Estimates:
        model, state = self.before(window)
        return self.after(window, *model.predict(state, window))

    @abstractmethod
    def before(self, window: Window) -> tuple[Model, ModelState]:
        """Return the model to read a window by, and its state before the window."""

    @abstractmethod
    def after(self, window: Window, state: ModelState, estimates: Estimates) -> Estimates:
        """Take the state after a window, and return its estimates."""


class _Fixed(_Stream):
    """A model as it is."""

    def __init__(self, model: Model) -> None:
        self._model, self._state = model, ModelState()

    def before(self, window: Window) -> tuple[Model, ModelState]:  # noqa: ARG002
        return self._model, self._state

    def after(self, window: Window, state: ModelState, estimates: Estimates) -> Estimates:  # noqa: ARG002
        self._state = state
        return estimates


class _Followed(_Stream, Watching):
    """A model that is re-tuned by the windows that nothing touches."""

    def __init__(self, model: Model, signal: Signal, size: Samples) -> None:
        self._own = OwnString.of(signal, size, lowest=LOWEST, highest=HIGHEST)
        self._analyser = SpectrumAnalyser.of(signal, size)
        self._known = self._model = model
        self._string = self._own.string
        self._state, self._tuner = ModelState(), TunerState()
        self._has_heard, self._why_not = False, ""

    def before(self, window: Window) -> tuple[Model, ModelState]:
        if window.start <= self._state.start:
            self._use(self._known, self._own.string)
            self._has_heard = False
        before, self._tuner = self._tuner.tuning, self._own.step(self._tuner, window)
        tuning = self._tuner.tuning
        if tuning is not before and tuning is not None:
            self._has_heard = True
            self._follow(tuning)
        return self._model, self._state

    def after(self, window: Window, state: ModelState, estimates: Estimates) -> Estimates:
        self._state = state
        why_not = self._why_not if self._has_heard else self._why_elsewhere(window)
        if not why_not:
            return estimates
        return {name: Estimate.abstain(each.unit, why_not) for name, each in estimates.items()}

    @property
    def condition(self) -> Condition:
        """The pitch of the string, and how far it is off the one that it was known at."""
        tuning = self._tuner.tuning
        if tuning is None:
            return Condition(follows=not self._why_not)
        deviation = tuning.deviation(self._own.string)
        return Condition(open_frequency=tuning.open_frequency, deviation=deviation, follows=not self._why_not)

    def _use(self, model: Model, string: StringParams) -> None:
        """Read the windows to come by the model for a string."""
        start = self._state.start
        self._model, self._string, self._why_not = model, string, ""
        self._state = ModelState(start=start)  # the reference was relative to the string of before

    def _follow(self, tuning: Tuning) -> None:
        """Change to the model for a tuning where it lies too far off that in use."""
        if LOWEST <= tuning.deviation(self._string) <= HIGHEST:
            return
        string = tuning.tuned(self._own.string)
        try:
            self._use(self._known.tuned(string), string)
        except InputError:  # further off the training's string than a tuning can be estimated
            self._why_not = self._own.why_detuned(tuning, KNOWN)

    def _why_elsewhere(self, window: Window) -> str:
        """Return why not to read a window before the pitch is known, empty for no reason."""
        if why_unusable(window):
            return ""
        spectrum = self._analyser.analyse(window.samples)
        has_partials = bool(self._tuner.lines) and not self._tuner.refused
        if has_partials and spectrum.reading.untouched_score < MIN_SCORE:
            return UNKNOWN
        return self._own.why_elsewhere(self._analyser, spectrum, KNOWN)
