"""What was trained, as one object: from windows to contact, slip, position and force."""

from monochord.perception.model.context import ModelState
from monochord.perception.model.definition import Definition
from monochord.perception.model.files import folder_of, load, save
from monochord.perception.model.model import Model

__all__ = ["Definition", "Model", "ModelState", "folder_of", "load", "save"]
