"""The optional library for training."""

from typing import Any

from monochord.core.errors import required


def torch_library() -> Any:
    """Return the module torch; raises `MissingLibraryError` if it is not installed."""
    with required("Training", "torch >= 2.6", "train"):
        import torch  # noqa: PLC0415
    return torch
