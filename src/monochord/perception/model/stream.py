"""A model on one stream of windows, which follows the pitch; the live loop and `Model.predict` use it."""

from abc import ABC, abstractmethod
from copy import deepcopy
from typing import Self

from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.types import Estimate, Estimates, Signal, StringParams, Window
from monochord.core.units import Samples
from monochord.dsp.microphones import Microphones
from monochord.metrics import DECISION
from monochord.perception.model.faults import OF_REASON
from monochord.perception.model.prepared import PreparedModel
from monochord.perception.model.state import ModelState
from monochord.perception.model.stepping import ModelInput, model_input, step_all
from monochord.perception.spectrum import Spectrum
from monochord.perception.tuning import Tuner, TunerState, Tuning
from monochord.perception.tuning.sessions import HIGHEST, LOWEST
from monochord.perception.tuning.tuner import detuned
from monochord.perception.usable import PitchJumps, UntouchedStringCheck
from monochord.perception.watching import Condition, Watching
from monochord.physics.theory import open_frequency

UNTOUCHED = 0.1
"""Largest probability of contact at which the untouched string is heard."""
EXPECTED_PITCH = "the pitch that this model expects"
LASTING = {fault.reason for fault in OF_REASON.values() if not fault.reason.brief}
"""Reasons of faults that do not end with a touch."""


class ModelStream(ABC):
    """A model on one stream of windows; call it with each window in order to get the estimates.

    Where two channels are not two microphones of one string, every estimate is an abstention.
    """

    def __init__(self) -> None:
        self._microphones = Microphones()

    def __call__(self, window: Window) -> Estimates:
        """Return the estimates of the next window."""
        return self.after(*step_all([self.before(window)])[0])

    def copy(self) -> Self:
        """Return a stream that goes on from here by itself; the model is shared.

        A simulator resets with it: the copy of a stream that knows the untouched string knows it, too.
        """
        return deepcopy(self, {id(each): each for each in self._shared})

    @property
    @abstractmethod
    def _shared(self) -> tuple[object, ...]:
        """What never changes, which copies share."""

    def before(self, window: Window) -> ModelInput:
        """Return a window as input of the model that is applied to it."""
        window_input, inputs = self._input(window), self._microphones(window)
        return window_input._replace(reason=window_input.reason or inputs.reason)

    @abstractmethod
    def after(self, state: ModelState, estimates: Estimates) -> Estimates:
        """Store the state after a window, and return the window's estimates."""

    @abstractmethod
    def _input(self, window: Window) -> ModelInput:
        """Return a window as input of the model that is applied to it."""


class FixedPitchStream(ModelStream):
    """A model that does not follow the pitch."""

    def __init__(self, model: PreparedModel) -> None:
        super().__init__()
        self._model, self._state = model, ModelState()

    @property
    def _shared(self) -> tuple[object, ...]:
        return (self._model,)

    def _input(self, window: Window) -> ModelInput:
        """Return the window as input of the model."""
        return model_input(self._model, self._state, window)

    def after(self, state: ModelState, estimates: Estimates) -> Estimates:
        """Store the state, and return the estimates unchanged."""
        self._state = state
        return estimates


class FollowedPitchStream(ModelStream, Watching):
    """A model that follows the pitch of untouched windows."""

    def __init__(self, model: PreparedModel, signal: Signal, size: Samples) -> None:
        super().__init__()
        self._tuner = Tuner.of(signal, size)
        self._trained, self._string = model, self._tuner.string
        self._model, self._pitch = model, self._tuner.nominal
        self._state, self._tuned = ModelState(), TunerState()
        self._may_state, self._jumps = UntouchedStringCheck(signal.sample_rate), PitchJumps()
        self._reason = ""
        self._gate = model.gate

    @property
    def _shared(self) -> tuple[object, ...]:
        return self._model, self._trained, self._tuner

    def _input(self, window: Window) -> ModelInput:
        """Update the pitch from the window, and return it as input of the model for this pitch."""
        if window.start <= self._state.start:
            self._use(self._trained, self._string)
        window_input = model_input(self._model, self._state, window)
        if window_input.spectrum is not None and self._has_jumped(window, window_input.spectrum):
            self._may_state.forget()
            self._tuned = TunerState()
            self._use(self._trained, self._string)
            window_input = model_input(self._model, self._state, window)
        before, self._tuned = self._tuned.tuning, self._tuner.step(self._tuned, window, window_input.spectrum)
        tuning = self._tuned.tuning
        if tuning is before or tuning is None or LOWEST <= tuning.frequency / self._pitch - 1.0 <= HIGHEST:
            return window_input
        self._follow(tuning)
        return model_input(self._model, self._state, window, window_input.spectrum)

    def after(self, state: ModelState, estimates: Estimates) -> Estimates:
        """Store the state, and return the estimates; abstentions if the pitch cannot be followed.

        Under a touch they are abstentions, too, in a stream whose untouched string was not heard.
        """
        self._state = state
        contact, reason = estimates[self._gate], self._reason
        may_state = self._may_state(state.start, heard=contact.valid and contact.value < UNTOUCHED)
        if not reason and not may_state and contact.valid and contact.value >= DECISION:
            # One that lasts tells more: a silent driver may be why no untouched string is heard.
            faults = {each.reason for each in estimates.values() if each.reason in LASTING}
            reason = faults.pop() if faults else Reason.UNTOUCHED_MISSING
        return _abstaining(estimates, reason) if reason else estimates

    @property
    def condition(self) -> Condition:
        """The pitch of the string, its deviation from the expected pitch, and what the channels carry."""
        tuning, inputs = self._tuned.tuning, self._microphones.inputs
        if tuning is None:
            return Condition(follows=not self._reason, inputs=inputs)
        return Condition(
            open_frequency=tuning.open_frequency,
            deviation=tuning.deviation(self._string),
            follows=not self._reason,
            inputs=inputs,
        )

    def _has_jumped(self, window: Window, spectrum: Spectrum) -> bool:
        """Return whether the pitch of everything jumps, as where the sample rate changes."""
        return self._jumps(window.start, window.samples.shape[1], spectrum.frequency, spectrum.height)

    def _use(self, model: PreparedModel, string: StringParams) -> None:
        """Read the windows to come by the model for a string."""
        start = self._state.start
        self._model, self._pitch, self._reason = model, open_frequency(string), ""
        self._state = ModelState(start=start)  # the memory was relative to the string of before

    def _follow(self, tuning: Tuning) -> None:
        """Change to the model for a tuning that lies too far off that in use."""
        string = tuning.tuned(self._string)
        try:
            self._use(self._trained.tuned(string), string)
        except InputError:  # further off the training's string than a tuning can be estimated
            deviation = tuning.deviation(self._string)
            self._reason = "" if LOWEST <= deviation <= HIGHEST else detuned(deviation, EXPECTED_PITCH)


def _abstaining(estimates: Estimates, reason: str) -> Estimates:
    return {name: Estimate.abstain(each.unit, reason) for name, each in estimates.items()}
