"""The learned estimator: contact, slip, position and force by a trained model."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from monochord.core.types import Estimates, Prepared, Signal, Window
from monochord.core.units import Samples
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import Model, load
from monochord.perception.model.stream import ModelStream


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
        return load(self.path).stream(signal, size)

    def estimate_all(self, prepared: Sequence[Prepared], windows: Sequence[Window]) -> list[Estimates]:
        """Return the estimates of windows of several strings; the heads are computed for all at once."""
        streams = [each for each in prepared if isinstance(each, ModelStream)]
        if len(streams) != len(prepared) or len(streams) < 2:
            return Estimator.estimate_all(self, prepared, windows)
        before = [stream.before(window) for stream, window in zip(streams, windows, strict=True)]
        predicted = zip(streams, windows, Model.step_all(before, windows), strict=True)
        return [stream.after(window, state, estimates) for stream, window, (state, estimates) in predicted]
