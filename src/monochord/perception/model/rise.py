"""Inputs that force is nearly linear in: how far a touch raises the pitch, over the untouched string's.

A light press F at x on something rigid raises the open frequency by the share E A F^2 x (L - x) / (4 L^2 T^3)
(`physics.theory.geometric_tension`), so that F goes as the root of the rise over 4 x (L - x) / L^2. Something
compliant lowers it, at a light touch by many times more, which a logarithm keeps in range. Neither is linear
in the columns of a feature, and layers that have to find both out of them find less.
"""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.kernels import kernel
from monochord.core.types import Audio

COLUMNS = ("ratio open", "ratio rest", "ratio place")
"""Columns of the feature: both readings of the open frequency in thousandths, and the place x / L."""
REFERENCE = "open"
"""Column of the untouched reference that they are compared with."""
COUNT = 5
KNEE = 2.0
"""Rise, in thousandths, from which on its size counts by the logarithm; noise is below."""
NEAREST_END = 0.05
"""Least distance of a place from an end, over the length."""


def rises(row: Audio, reference: Audio, columns: tuple[int, ...]) -> Audio:
    """Return the inputs (..., `COUNT`) of rows of the feature (..., d), each with its reference (..., c).

    They are ``asinh(r / KNEE)`` and ``sign(r) sqrt(|r| / g)`` of both rises r, and g = 4 x (L - x) / L^2.
    Without a reference all are 0. `columns` are those of `COLUMNS`, and that of `REFERENCE`.

    Examples
    --------
    >>> row, reference = np.array([4.0, 0.0, 0.5], np.float32), np.array([0.0, 1.0], np.float32)
    >>> rises(row, reference, (0, 1, 2, 0)).round(2).tolist()
    [1.44..., 0.0, 2.0, 0.0, 1.0]
    """
    if not (max(columns[:3]) < row.shape[-1] and columns[3] < reference.shape[-1]):
        given = f"rows of {row.shape[-1]} columns and a reference of {reference.shape[-1]}"
        raise InputError(given, f"the columns {columns}")
    rows, references = row.reshape(-1, row.shape[-1]), reference.reshape(-1, reference.shape[-1])
    return _rises(rows, references, columns).reshape(*row.shape[:-1], COUNT)


@kernel()
def _rises(rows: Audio, references: Audio, columns: tuple[int, ...]) -> Audio:
    pitch, rest, at, untouched = columns
    inputs = np.zeros((rows.shape[0], COUNT), np.float32)
    for k in range(rows.shape[0]):
        if references[k, -1] > 0.0:
            place = min(max(rows[k, at], NEAREST_END), 1.0 - NEAREST_END)
            depth = 4.0 * place * (1.0 - place)
            for which, column in enumerate((pitch, rest)):
                rise = rows[k, column] - references[k, untouched]
                inputs[k, which] = np.arcsinh(rise / KNEE)
                inputs[k, 2 + which] = np.sign(rise) * np.sqrt(abs(rise) / depth)
            inputs[k, 4] = depth
    return inputs
