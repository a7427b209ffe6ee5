"""What was learned, as one object: from windows to contact, slip, position and force."""

from monochord.perception.model.definition import Definition
from monochord.perception.model.files import folder_of, load, save
from monochord.perception.model.model import Listening, Model

__all__ = ["Definition", "Listening", "Model", "folder_of", "load", "save"]
