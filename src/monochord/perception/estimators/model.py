"""The learned estimator: contact, slip, position and force from a trained model."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from monochord.core.types import Estimates, Prepared, Signal, Window
from monochord.core.units import Samples, Seconds
from monochord.perception.estimators._loaded import LoadedModel
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import load


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelEstimator(Estimator):
    """A model from ``monochord train`` on one stream of windows, in order.

    A window that starts no later than its predecessor begins another stream. Features are relative to the
    tuning of the signal's sensor. If untouched windows show another tuning, features follow it, as in
    training. Before the first untouched window, the model abstains from touched windows of a detuned string,
    and the reason states the deviation.

    Parameters
    ----------
    path
        Folder of a model, folder of its training run, or the name of a bundled model: demo.
    """

    path: Path

    @property
    def model(self) -> str:
        """The folder or the name of the model."""
        return str(self.path)

    @cached_property
    def learned(self) -> LoadedModel:
        """The model itself, loaded at first use; raises `InputError` if there is none."""
        return LoadedModel(loaded=load(self.path))

    @property
    def sample_rate(self) -> int:
        """The rate of the model's training, in Hz."""
        return self.learned.sample_rate

    @property
    def window(self) -> Seconds:
        """The length in s of the windows of the model's training."""
        return self.learned.window

    @property
    def tick(self) -> Seconds | None:
        """The time in s between the windows that the model's memory hears; None without memory."""
        return self.learned.tick

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Adapt the model to the string's tuning, and check that it fits the signal."""
        return self.learned.prepare(signal, size)

    def estimate_all(self, prepared: Sequence[Prepared], windows: Sequence[Window]) -> list[Estimates]:
        """Return the estimates for one window of each of several strings; all heads are computed at once."""
        return self.learned.estimate_all(prepared, windows)
