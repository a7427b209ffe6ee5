"""Metrics, plain functions of (reference, estimate) in SI units.

A value that is not a number is refused; select rows with `known` first.
`regression_score` and `detection_score` collect all scores of an output and count NaN as an abstention.
"""

from monochord.metrics.bootstrap import bootstrap_interval, time_blocks
from monochord.metrics.calibration import (
    brier_score,
    calibration_error,
    coverage,
    normal_coverage,
    reliability,
)
from monochord.metrics.classification import accuracy, balanced_accuracy, confusion
from monochord.metrics.events import detection_delays, false_alarms, stretches
from monochord.metrics.ranking import Groups, area_interval, area_under_curve
from monochord.metrics.regression import known, mean_absolute_error, mean_error, pearson_r, rms_error, within
from monochord.metrics.scores import (
    DECISION,
    LIMITS,
    DetectionScore,
    RegressionScore,
    decision_accuracy,
    detection_score,
    hit_rate,
    regression_score,
)

__all__ = [
    "DECISION",
    "LIMITS",
    "DetectionScore",
    "Groups",
    "RegressionScore",
    "accuracy",
    "area_interval",
    "area_under_curve",
    "balanced_accuracy",
    "bootstrap_interval",
    "brier_score",
    "calibration_error",
    "confusion",
    "coverage",
    "decision_accuracy",
    "detection_delays",
    "detection_score",
    "false_alarms",
    "hit_rate",
    "known",
    "mean_absolute_error",
    "mean_error",
    "normal_coverage",
    "pearson_r",
    "regression_score",
    "reliability",
    "rms_error",
    "stretches",
    "time_blocks",
    "within",
]
