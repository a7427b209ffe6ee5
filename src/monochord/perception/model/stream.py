"""A model on one stream of windows, which follows the pitch; the live loop and `Model.predict` use it."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from monochord.core.errors import InputError
from monochord.core.types import Estimate, Estimates, Signal, StringParams, Window
from monochord.core.units import Samples
from monochord.perception.estimators.base import Condition, Watching
from monochord.perception.model.context import ModelState
from monochord.perception.tuning import StringFollower, TunerState, Tuning
from monochord.perception.tuning.sessions import HIGHEST, LOWEST

if TYPE_CHECKING:
    from monochord.perception.model.model import Model

EXPECTED_PITCH = "the pitch that this model expects"


class ModelStream(ABC):
    """A model on one stream of windows; call it with each window in order to get the estimates."""

    def __call__(self, window: Window) -> Estimates:
        """Return the estimates of the next window."""
        model, state = self.before(window)
        return self.after(*model.step(state, window))

    @abstractmethod
    def before(self, window: Window) -> "tuple[Model, ModelState]":
        """Return the model to apply to a window, and its state before the window."""

    @abstractmethod
    def after(self, state: ModelState, estimates: Estimates) -> Estimates:
        """Store the state after a window, and return the window's estimates."""


class Fixed(ModelStream):
    """A model that does not follow the pitch."""

    def __init__(self, model: "Model") -> None:
        self._model, self._state = model, ModelState()

    def before(self, window: Window) -> "tuple[Model, ModelState]":  # noqa: ARG002
        """Return the model and its state."""
        return self._model, self._state

    def after(self, state: ModelState, estimates: Estimates) -> Estimates:
        """Store the state, and return the estimates unchanged."""
        self._state = state
        return estimates


class Followed(ModelStream, Watching):
    """A model that follows the pitch of untouched windows."""

    def __init__(self, model: "Model", signal: Signal, size: Samples) -> None:
        self._follower = StringFollower.of(signal, size, lowest=LOWEST, highest=HIGHEST)
        self._trained = self._model = model
        self._string = self._follower.string
        self._state, self._tuner = ModelState(), TunerState()
        self._reason = ""

    def before(self, window: Window) -> "tuple[Model, ModelState]":
        """Update the pitch from the window, and return the model for this pitch with its state."""
        if window.start <= self._state.start:
            self._use(self._trained, self._follower.string)
        before, self._tuner = self._tuner.tuning, self._follower.step(self._tuner, window)
        tuning = self._tuner.tuning
        if tuning is not before and tuning is not None:
            self._follow(tuning)
        return self._model, self._state

    def after(self, state: ModelState, estimates: Estimates) -> Estimates:
        """Store the state, and return the estimates; abstentions if the pitch cannot be followed."""
        self._state = state
        if not self._reason:
            return estimates
        return {name: Estimate.abstain(each.unit, self._reason) for name, each in estimates.items()}

    @property
    def condition(self) -> Condition:
        """The pitch of the string, and its deviation from the expected pitch."""
        tuning = self._tuner.tuning
        if tuning is None:
            return Condition(follows=not self._reason)
        deviation = tuning.deviation(self._follower.string)
        return Condition(open_frequency=tuning.open_frequency, deviation=deviation, follows=not self._reason)

    def _use(self, model: "Model", string: StringParams) -> None:
        """Read the windows to come by the model for a string."""
        start = self._state.start
        self._model, self._string, self._reason = model, string, ""
        self._state = ModelState(start=start)  # the reference was relative to the string of before

    def _follow(self, tuning: Tuning) -> None:
        """Change to the model for a tuning where it lies too far off that in use."""
        if LOWEST <= tuning.deviation(self._string) <= HIGHEST:
            return
        string = tuning.tuned(self._follower.string)
        try:
            self._use(self._trained.tuned(string), string)
        except InputError:  # further off the training's string than a tuning can be estimated
            self._reason = self._follower.detuned_reason(tuning, EXPECTED_PITCH)
