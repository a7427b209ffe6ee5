"""What was learned, as one object: from windows to contact, slip, position and force."""

from monochord.perception.model.definition import Definition
from monochord.perception.model.files import folder_of, load, save
from monochord.perception.model.perceiver import Listening, Perceiver

__all__ = ["Definition", "Listening", "Perceiver", "folder_of", "load", "save"]
