"""A model in memory as an estimator, for use from Python; not available on the command line."""

from collections.abc import Sequence
from dataclasses import dataclass

from monochord.core.types import Estimates, Prepared, Signal, Window
from monochord.core.units import Samples, Seconds
from monochord.perception.estimators.base import Estimator
from monochord.perception.estimators.model import all_at_once
from monochord.perception.model import Model


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedModel(Estimator):
    """The estimator `model` of a model that is loaded already."""

    loaded: Model

    @property
    def tick(self) -> Seconds | None:
        """The time in s between the windows that the model's memory hears; None without memory."""
        return self.loaded.tick

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Adapt the model to the string's tuning, and check that it fits the signal."""
        return self.loaded.stream(signal, size)

    def estimate_all(self, prepared: Sequence[Prepared], windows: Sequence[Window]) -> list[Estimates]:
        """Return the estimates for one window of each of several strings; all heads are computed at once."""
        return all_at_once(self, prepared, windows)
