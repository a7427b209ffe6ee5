"""What was learned, as one object: from windows to contact, slip, position and force."""

from monochord.perceiver.definition import Definition
from monochord.perceiver.files import folder_of, load, save
from monochord.perceiver.perceiver import Listening, Perceiver

__all__ = ["Definition", "Listening", "Perceiver", "folder_of", "load", "save"]
