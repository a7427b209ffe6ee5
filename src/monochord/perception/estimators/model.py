"""The learned estimator: contact, slip, position and force from a trained model."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from monochord.core.types import Estimates, Prepared, Signal, Window
from monochord.core.units import Samples, Seconds
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import load
from monochord.perception.model.stepping import step_all
from monochord.perception.model.stream import ModelStream


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

    @property
    def sample_rate(self) -> int:
        """The rate of the model's training, in Hz; raises `InputError` if there is no model."""
        return load(self.path).definition.sample_rate

    @property
    def tick(self) -> Seconds | None:
        """The time in s between the windows that the model's memory hears; None without memory."""
        return load(self.path).tick

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Load the model, adapt it to the string's tuning, and check that it fits the signal."""
        return load(self.path).stream(signal, size)

    def estimate_all(self, prepared: Sequence[Prepared], windows: Sequence[Window]) -> list[Estimates]:
        """Return the estimates for one window of each of several strings; all heads are computed at once."""
        return all_at_once(self, prepared, windows)


def all_at_once(
    estimator: Estimator, prepared: Sequence[Prepared], windows: Sequence[Window]
) -> list[Estimates]:
    """Return the estimates of an estimator's prepared models for one window each, all heads at once."""
    streams = [each for each in prepared if isinstance(each, ModelStream)]
    if len(streams) != len(prepared) or len(streams) < 2:
        return Estimator.estimate_all(estimator, prepared, windows)
    inputs = [stream.before(window) for stream, window in zip(streams, windows, strict=True)]
    return [stream.after(*each) for stream, each in zip(streams, step_all(inputs), strict=True)]
