"""Inputs in which force is nearly linear: the rise of the pitch above the untouched string's.

A light press F at x by a rigid object raises the open frequency by the share E A F^2 x (L - x) / (4 L^2 T^3)
(`physics.theory.geometric_tension`). So F is proportional to the square root of the rise divided by 4 x (L -
x) / L^2. A compliant object lowers the pitch, at a light touch by many times more; a logarithm limits this
range. Neither relation is linear in a feature's columns, and hidden layers that have to learn both are less
accurate.
"""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.kernels import kernel
from monochord.core.types import Audio

COLUMNS = ("open", "position")
"""Columns of the feature: the open pitch under the touch in thousandths, and the position x / L."""
REFERENCES = ("rest", "lowest")
"""Columns of the untouched reference that the pitch is compared with: two readings of the open pitch."""
COUNT = 5
KNEE = 2.0
"""Rise in thousandths above which the input is logarithmic; noise lies below."""
NEAREST_END = 0.05
"""Smallest distance of a position from an end, as a share of the length."""


def rises(row: Audio, reference: Audio, columns: tuple[int, ...]) -> Audio:
    """Return the inputs (..., `COUNT`) from features (..., d) and their references (..., c).

    The inputs are ``asinh(r / KNEE)`` of the rises r over both readings of the untouched pitch, ``sign(r)
    sqrt(|r| / g)`` of both, and g = 4 x (L - x) / L^2. Without a reference, all are 0. `columns` are the
    indices of `COLUMNS` in the feature and of `REFERENCES` in the reference.

    Examples
    --------
    >>> row, reference = np.array([4.0, 0.5], np.float32), np.array([0.0, 4.0, 1.0], np.float32)
    >>> rises(row, reference, (0, 1, 0, 1)).round(2).tolist()
    [1.44..., 0.0, 2.0, 0.0, 1.0]
    """
    if not (max(columns[:2]) < row.shape[-1] and max(columns[2:]) < reference.shape[-1]):
        given = f"rows of {row.shape[-1]} columns and a reference of {reference.shape[-1]}"
        raise InputError(given, f"columns with the indices {columns}")
    rows, references = row.reshape(-1, row.shape[-1]), reference.reshape(-1, reference.shape[-1])
    return _rises(rows, references, columns).reshape(*row.shape[:-1], COUNT)


@kernel()
def _rises(rows: Audio, references: Audio, columns: tuple[int, ...]) -> Audio:
    pitch, at = columns[:2]
    inputs = np.zeros((rows.shape[0], COUNT), np.float32)
    for k in range(rows.shape[0]):
        if references[k, -1] > 0.0:
            place = min(max(rows[k, at], NEAREST_END), 1.0 - NEAREST_END)
            depth = 4.0 * place * (1.0 - place)
            for which, column in enumerate(columns[2:]):
                rise = rows[k, pitch] - references[k, column]
                inputs[k, which] = np.arcsinh(rise / KNEE)
                inputs[k, 2 + which] = np.sign(rise) * np.sqrt(abs(rise) / depth)
            inputs[k, 4] = depth
    return inputs
