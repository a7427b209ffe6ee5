"""MuJoCo, of the extra `sim`; it ships no types."""

from importlib import import_module
from typing import Any

from monochord.core.errors import required

__all__ = ["mujoco"]

with required("A string in MuJoCo", "mujoco >= 4.0", "sim"):
    mujoco: Any = import_module("mujoco")
