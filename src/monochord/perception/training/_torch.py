"""The library that trains, where it is installed."""

from typing import Any

from monochord.core.errors import InputError


def torch_library() -> Any:
    """Return torch; raises `InputError` where it is not installed."""
    try:
        import torch  # noqa: PLC0415
    except ImportError as error:
        given = "training without torch, which is not installed"
        raise InputError(given, "torch 2.6 or newer", "install it: pip install 'monochord[train]'") from error
    return torch
