"""The learned estimator: contact, slip, position and force from a trained model."""

from dataclasses import dataclass
from pathlib import Path

from monochord.perception.estimators._loaded import LearnedEstimator
from monochord.perception.model import Model, load


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelEstimator(LearnedEstimator):
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

    def load(self) -> Model:
        """Return the model."""
        return load(self.path)
