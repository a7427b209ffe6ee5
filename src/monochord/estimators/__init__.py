"""From a window to estimates: one file an estimator, found by its name."""

from monochord.estimators.base import Estimator
from monochord.registry import Registry

ESTIMATORS: Registry[Estimator] = Registry("monochord.estimators", Estimator)

__all__ = ["ESTIMATORS"]
