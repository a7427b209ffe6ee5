"""Estimators that a trained model answers for; one of a model in memory is for use from Python."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from monochord.core.types import Estimates, Prepared, Signal, Window
from monochord.core.units import Samples, Seconds
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import Model
from monochord.perception.model.stepping import step_all
from monochord.perception.model.stream import ModelStream


class LearnedEstimator(Estimator):
    """An estimator that a trained model answers for."""

    @abstractmethod
    def load(self) -> Model:
        """Return the model."""

    @cached_property
    def learned(self) -> Model:
        """The model itself, loaded at first use; raises `InputError` if there is none."""
        return self.load()

    @property
    def sample_rate(self) -> int:
        """The rate of the model's training, in Hz."""
        return self.learned.definition.sample_rate

    @property
    def window(self) -> Seconds:
        """The length in s of the windows of the model's training."""
        return self.learned.definition.window / self.sample_rate

    @property
    def tick(self) -> Seconds | None:
        """The time in s between the windows that the model's memory hears; None without memory."""
        return self.learned.tick

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Adapt the model to the string's tuning, and check that it fits the signal."""
        return self.learned.stream(signal, size)

    def estimate_all(self, prepared: Sequence[Prepared], windows: Sequence[Window]) -> list[Estimates]:
        """Return the estimates for one window of each of several strings; all heads are computed at once."""
        streams = [each for each in prepared if isinstance(each, ModelStream)]
        if len(streams) != len(prepared) or len(streams) < 2:
            return Estimator.estimate_all(self, prepared, windows)
        inputs = [stream.before(window) for stream, window in zip(streams, windows, strict=True)]
        return [stream.after(*each) for stream, each in zip(streams, step_all(inputs), strict=True)]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedModel(LearnedEstimator):
    """The estimator `model` of a model that is loaded already."""

    loaded: Model

    def load(self) -> Model:
        """Return the model."""
        return self.loaded
