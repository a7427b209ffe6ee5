"""Metrics, plain functions of (reference, estimate) in SI units.

Non-finite values raise; select rows with `finite_rows` first. `regression_score` and `detection_score`
compute all scores of an output and count NaN as an abstention.
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
from monochord.metrics.regression import (
    finite_rows,
    mean_absolute_error,
    mean_error,
    pearson_r,
    rms_error,
    within,
)
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
    "finite_rows",
    "hit_rate",
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
