"""The optional library for training."""

from typing import Any

from monochord.core.errors import MissingLibraryError


def torch_library() -> Any:
    """Return the module torch; raises `MissingLibraryError` if it is not installed."""
    try:
        import torch  # noqa: PLC0415
    except ImportError as error:
        raise MissingLibraryError("Training", "torch >= 2.6", "train") from error
    return torch
