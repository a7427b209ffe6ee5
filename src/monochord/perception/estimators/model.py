"""The learned estimator: contact, slip, position and force by a trained model."""

from dataclasses import dataclass
from pathlib import Path

from monochord.core.types import Estimates, Prepared, Signal, Window
from monochord.core.units import Samples
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import ModelState, load


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelEstimator(Estimator):
    """A model that ``monochord train`` trained, on one stream of windows in order.

    A window that does not begin after the one before it begins another stream.

    Parameters
    ----------
    path
        Folder of a model or of the training run that made it, or the name of a bundled one: demo.
    """

    path: Path

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Load the model and check that it fits the signal."""
        model, state = load(self.path), ModelState()
        model.check(signal, size)

        def estimate(window: Window) -> Estimates:
            nonlocal state
            state, estimates = model.predict(state, window)
            return estimates

        return estimate
