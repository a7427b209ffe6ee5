"""Argument checks shared by all metrics."""

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Floats


def numbers(**named: Floats) -> tuple[Floats, ...]:
    """Return arrays as float64; they must be one-dimensional, nonempty, finite and of equal length."""
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in named.items()}
    shapes = {name: values.shape for name, values in arrays.items()}
    if len(set(shapes.values())) != 1 or any(values.ndim != 1 for values in arrays.values()):
        given = ", ".join(f"{name} of shape {shape}" for name, shape in shapes.items())
        raise InputError(given, "one dimension, the same length")
    for name, values in arrays.items():
        if values.size == 0:
            raise InputError(f"no {name}", "at least one value")
        bad = int(np.count_nonzero(~np.isfinite(values)))
        if bad:
            raise InputError(
                f"{bad} of {values.size} in {name} not finite", "numbers", "select rows with finite_rows()"
            )
    return tuple(arrays.values())


def decisions(**named: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], ...]:
    """Return boolean arrays, checked as in `numbers`; 0 and 1 mean no and yes."""
    arrays = numbers(**{name: np.asarray(values, np.float64) for name, values in named.items()})
    for name, values in zip(named, arrays, strict=True):
        odd = values[(values != 0.0) & (values != 1.0)]
        if odd.size > 0:
            raise InputError(f"{odd[0]:g} in {name}", "0 and 1, or false and true")
    return tuple(values == 1.0 for values in arrays)


def probabilities(values: Floats) -> None:
    """Raise `InputError` unless every value is between 0 and 1."""
    if values.min() < 0.0 or values.max() > 1.0:
        raise InputError(f"probabilities {values.min():g} to {values.max():g}", "0 to 1")
