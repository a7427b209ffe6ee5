"""Estimators: from a window to estimates, one file each, found by name."""

from monochord.core.registry import Registry
from monochord.perception.estimators.base import Estimator

ESTIMATORS: Registry[Estimator] = Registry("monochord.perception.estimators", Estimator)

__all__ = ["ESTIMATORS"]
