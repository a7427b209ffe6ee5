"""Training a model on a dataset, and adapting a model to known touches."""

from monochord.perception.training._torch import torch_library
from monochord.perception.training.adapt import REMEDY, Objects, adapt
from monochord.perception.training.configs import config_path
from monochord.perception.training.correct import Replayed, correctable, counting, with_residuals
from monochord.perception.training.examples import stream_of, touches_of
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import read_in_turn, train

__all__ = [
    "REMEDY",
    "Objects",
    "Replayed",
    "TrainingSettings",
    "adapt",
    "config_path",
    "correctable",
    "counting",
    "read_in_turn",
    "stream_of",
    "torch_library",
    "touches_of",
    "train",
    "with_residuals",
]
