"""Evaluation of estimators on takes with ground truth: replay, scores, baselines and the report."""

from monochord.evaluation.baselines import RIDGE, Baselines, features_of, fit_baselines
from monochord.evaluation.evaluate import Evaluation, evaluate, write
from monochord.evaluation.noise import motor
from monochord.evaluation.paper import keep_rows, paper_rows
from monochord.evaluation.recordings import (
    RATE,
    REMEDY,
    SCALE,
    RealTake,
    folder,
    interference_recordings,
    takes,
)
from monochord.evaluation.replay import Selection, replay, replay_estimators
from monochord.evaluation.results import CLEAN, Results, Trial, join, read_results, write_results
from monochord.evaluation.scorecard import EVERYTHING, Scorecard, scorecard
from monochord.evaluation.scores import (
    DRAWS,
    MIN_SESSIONS,
    Detection,
    Regression,
    Score,
    blocks_of,
    detection,
    regression,
    regression_rows,
    score_of,
)
from monochord.evaluation.select import (
    EvaluatedEstimator,
    EvaluationData,
    EvaluationSettings,
    load,
    refuse_trained_on,
    select,
    training_of,
)

__all__ = [
    "CLEAN",
    "DRAWS",
    "EVERYTHING",
    "MIN_SESSIONS",
    "RATE",
    "REMEDY",
    "RIDGE",
    "SCALE",
    "Baselines",
    "Detection",
    "EvaluatedEstimator",
    "Evaluation",
    "EvaluationData",
    "EvaluationSettings",
    "RealTake",
    "Regression",
    "Results",
    "Score",
    "Scorecard",
    "Selection",
    "Trial",
    "blocks_of",
    "detection",
    "evaluate",
    "features_of",
    "fit_baselines",
    "folder",
    "interference_recordings",
    "join",
    "keep_rows",
    "load",
    "motor",
    "paper_rows",
    "read_results",
    "refuse_trained_on",
    "regression",
    "regression_rows",
    "replay",
    "replay_estimators",
    "score_of",
    "scorecard",
    "select",
    "takes",
    "training_of",
    "write",
    "write_results",
]
