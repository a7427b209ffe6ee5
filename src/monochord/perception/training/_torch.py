"""The library that trains, where it is installed."""

from typing import Any

from monochord.core.errors import MissingLibraryError


def torch_library() -> Any:
    """Return torch; raises `MissingLibraryError` where it is not installed."""
    try:
        import torch  # noqa: PLC0415
    except ImportError as error:
        raise MissingLibraryError("Training", "torch >= 2.6", "train") from error
    return torch
