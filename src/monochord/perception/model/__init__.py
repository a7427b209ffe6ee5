"""A trained model as one object: from windows to contact, slip, position and force."""

from monochord.perception.model.bundled import bundled_folder
from monochord.perception.model.definition import Definition, FeatureRecord, HeadRecord
from monochord.perception.model.files import folder_of, load
from monochord.perception.model.model import Model
from monochord.perception.model.network import quantity
from monochord.perception.model.probe import probed
from monochord.perception.model.state import ModelState
from monochord.perception.model.table import EstimateColumn, PredictionTable

__all__ = [
    "Definition",
    "EstimateColumn",
    "FeatureRecord",
    "HeadRecord",
    "Model",
    "ModelState",
    "PredictionTable",
    "bundled_folder",
    "folder_of",
    "load",
    "probed",
    "quantity",
]
