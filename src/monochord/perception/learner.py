"""One head in scikit-learn's manner: fit, predict, score, on windows or on their features."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal
from monochord.metrics import accuracy
from monochord.perception.features import FEATURES
from monochord.perception.heads import HEADS
from monochord.perception.heads.base import Task
from monochord.perception.model.network import scaled
from monochord.perception.training.calibrate import spread_factor
from monochord.perception.training.linear import folds_of, solve
from monochord.physics.sensors import load_sensor

BATCH = 64
"""Windows whose features are computed at once."""
CLIP = 8.0
"""Bound of a scaled column, in standard deviations; that of a model."""
MIN_DEVIATION = 1e-6
"""Columns that vary by less are not scaled."""


class TouchEstimator(BaseEstimator):
    """One head on one feature, without an untouched reference: a baseline and a tool for studies.

    A quantity (position, force) is estimated by the linear path of a model's head, a robust ridge regression,
    with a standard error from windows of other touches; a probability (contact, slip) by logistic regression.
    It is an estimator of scikit-learn: it can be cloned, cross-validated and searched over.

    Parameters
    ----------
    head
        Name of the head: contact, slip, position or force.
    feature
        Name of the feature.
    options
        Options of the feature, such as ``{"tones": True}``.
    sensor
        Name of the sensor, whose string the feature uses.
    sample_rate
        Frames a second of the windows.

    Attributes
    ----------
    std_ : float
        Standard error of a quantity on touches that it is not fitted to, in the label's unit.
    n_features_in_ : int
        Columns of the feature.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> rows = rng.normal(size=(200, 5))
    >>> force = rows @ [0.5, 0.0, 0.2, 0.0, 0.0] + 1.0
    >>> estimator = TouchEstimator(head="force").fit(rows, force)
    >>> round(estimator.score(rows, force), 3)
    1.0
    >>> estimator.get_params()["head"]
    'force'
    """

    def __init__(
        self,
        head: str = "position",
        *,
        feature: str = "fft_harmonic",
        options: dict[str, Any] | None = None,
        sensor: str = "prototype",
        sample_rate: int = 44100,
    ) -> None:
        self.head = head
        self.feature = feature
        self.options = options
        self.sensor = sensor
        self.sample_rate = sample_rate

    def fit(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> "TouchEstimator":
        """Fit to windows and labels.

        Parameters
        ----------
        X
            Windows (n, channels, samples), or their features (n, columns).
        y
            Labels (n,): m, N, or 0 and 1.
        groups
            The touch or session (n,) of each window, whose windows are in one fold; each window is its own
            without it, and the standard error is then too small where neighbours are alike.

        Raises
        ------
        InputError
            If shapes do not fit, a label is not finite, or feature, head or sensor are unknown.
        """
        from sklearn.linear_model import LogisticRegression  # noqa: PLC0415

        task, rows, label = self._task(), self._rows(X), np.asarray(y, np.float64)
        if label.shape != (len(rows),) or not len(rows) or not np.isfinite(label).all():
            given = f"{len(rows)} windows with labels of shape {label.shape}"
            raise InputError(given, "one finite label for each of one window or more", "leave out the others")
        deviation = rows.std(axis=0, dtype=np.float64)
        self.mean_ = rows.mean(axis=0, dtype=np.float64).astype(np.float32)
        self.scale_ = np.where(deviation > MIN_DEVIATION, deviation, 1.0).astype(np.float32)
        self.n_features_in_ = rows.shape[1]
        inputs = scaled(rows, self.mean_, self.scale_, CLIP)
        if task.is_probability:
            self.classes_ = np.unique(label)
            self.logistic_ = LogisticRegression(max_iter=1000).fit(inputs, label == 1.0)
            return self
        group = (
            np.arange(len(rows)) if groups is None else np.unique(np.asarray(groups), return_inverse=True)[1]
        )
        self.offset_, self.label_scale_ = float(label.mean()), float(label.std()) or 1.0
        target = (label - self.offset_) / self.label_scale_
        path = solve([inputs], target, folds_of(np.zeros(len(rows), np.int64), group))
        weights = np.stack([weight for weight, _ in path.folds])[path.fold]
        bias = np.array([bias for _, bias in path.folds])[path.fold]
        error = target - (inputs * weights).sum(axis=1) - bias
        self.coef_, self.intercept_ = path.weight, path.bias
        self.std_ = self.label_scale_ * spread_factor(error, np.ones(len(error)), group)
        return self

    def predict(self, X: ArrayLike, *, return_std: bool = False) -> Any:
        """Return the estimates (n,): a quantity in its unit, or 0 and 1; with their standard errors if asked.

        Raises
        ------
        InputError
            If it is not fitted, or the shape is not that of the fit.
        """
        if self._task().is_probability:
            probability = self.predict_proba(X)[:, 1]
            value = (probability >= 0.5).astype(np.float64)
            return (value, np.sqrt(probability * (1.0 - probability))) if return_std else value
        inputs = self._inputs(X)
        value = self.offset_ + self.label_scale_ * (inputs @ self.coef_ + self.intercept_)
        return (value, np.full(len(value), self.std_)) if return_std else value

    def predict_proba(self, X: ArrayLike) -> Floats:
        """Return the probabilities (n, 2) of no and yes; for contact and slip alone."""
        if not self._task().is_probability:
            raise InputError(f"probabilities of {self.head}", "contact or slip", "use predict")
        return np.asarray(self.logistic_.predict_proba(self._inputs(X)))

    def score(self, X: ArrayLike, y: ArrayLike) -> float:
        """Return the coefficient of determination R^2 of a quantity, or the accuracy of a yes or no."""
        estimate, label = self.predict(X), np.asarray(y, np.float64)
        if self._task().is_probability:
            return accuracy(label == 1.0, estimate == 1.0)
        spread = float(np.sum((label - label.mean()) ** 2))
        return 1.0 - float(np.sum((label - estimate) ** 2)) / spread if spread else 0.0

    def _task(self) -> Task:
        return HEADS.build(self.head).task()

    def _rows(self, X: ArrayLike) -> Audio:
        """Return the features (n, columns) of windows; features stay as they are."""
        array = np.asarray(X, np.float32)
        if array.ndim == 2:
            return array
        if array.ndim != 3:
            allowed = "windows (n, channels, samples) or features (n, columns)"
            raise InputError(f"an array of shape {array.shape}", allowed)
        signal = Signal(
            sample_rate=self.sample_rate, channels=array.shape[1], string=load_sensor(self.sensor).string
        )
        extractor = FEATURES.build(self.feature, self.options or {}).prepare(signal, array.shape[2])
        rows = np.empty((len(array), len(extractor.columns)), np.float32)
        for first in range(0, len(array), BATCH):
            rows[first : first + BATCH] = extractor(array[first : first + BATCH])
        return rows

    def _inputs(self, X: ArrayLike) -> NDArray[np.float32]:
        if not hasattr(self, "mean_"):
            raise InputError("an estimator that is not fitted", "one that is", "call fit first")
        rows = self._rows(X)
        if rows.shape[1] != self.n_features_in_:
            given = f"{rows.shape[1]} columns"
            raise InputError(given, f"{self.n_features_in_}, as in fit", "use the same feature and windows")
        return scaled(rows, self.mean_, self.scale_, CLIP)
