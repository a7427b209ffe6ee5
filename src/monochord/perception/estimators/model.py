"""The learned estimator: contact, slip, position and force as a model tells them."""

from dataclasses import dataclass
from pathlib import Path

from monochord.core.errors import InputError
from monochord.core.types import Prepared, Signal
from monochord.core.units import Samples
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import load


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelEstimator(Estimator):
    """What ``monochord train`` learned, with the untouched string that it keeps as a reference.

    Windows are read in the order of one stream. One that does not begin after the one before it begins
    another stream.

    Parameters
    ----------
    path
        Folder of a model or of the training run that made it, or the name of one that comes along: demo.
    """

    path: Path

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Load it and make it ready for such a signal."""
        model = load(self.path)
        listening, told = model.open(signal), model.definition
        if size != told.window:
            given = f"windows of {size} frames for a model"
            remedy = f"take --window {told.window / told.sample_rate:g}"
            raise InputError(given, f"{told.window} frames at {told.sample_rate} Hz", remedy)
        return listening.predict
