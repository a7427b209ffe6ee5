"""Weights of the small networks that read modes, as files of the package hold them."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Weights: TypeAlias = NDArray[np.floating[Any]]
"""Single precision as read from a file, of which a vector unit takes twice as many; double in training."""


def read_weights(file: Path, names: Iterable[str]) -> list[Weights]:
    """Return the arrays of these names in a safetensors file, in their order."""
    from safetensors.numpy import load  # noqa: PLC0415

    arrays = load(file.read_bytes())
    return [np.ascontiguousarray(arrays[name], np.float32) for name in names]
