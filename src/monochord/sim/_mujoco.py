"""MuJoCo, of the extra `sim`; it ships no types."""

from importlib import import_module
from typing import Any

from monochord.core.errors import MissingLibraryError

__all__ = ["mujoco"]

try:
    mujoco: Any = import_module("mujoco")
except ImportError as error:
    raise MissingLibraryError("A string in MuJoCo", "mujoco >= 4.0", "sim") from error
