"""Inputs that force is nearly linear in: how far a touch raises the pitch, over the untouched string's.

A light press F at x on something rigid raises the open frequency by the share E A F^2 x (L - x) / (4 L^2 T^3)
(`physics.theory.geometric_tension`), so that F goes as the root of the rise over 4 x (L - x) / L^2. Something
compliant lowers it, at a light touch by many times more, which a logarithm keeps in range. Neither is linear
in the columns of a feature, and layers that have to find both out of them find less.
"""

import numpy as np

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

    They are asinh(r / `KNEE`) and sign(r) sqrt(|r| / g) of both rises r, and g = 4 x (L - x) / L^2. Without a
    reference all are 0. `columns` are those of `COLUMNS`, and that of `REFERENCE`.

    Examples
    --------
    >>> row, reference = np.array([4.0, 0.0, 0.5], np.float32), np.array([0.0, 1.0], np.float32)
    >>> rises(row, reference, (0, 1, 2, 0)).round(2).tolist()
    [1.44..., 0.0, 2.0, 0.0, 1.0]
    """
    pitch, rest, at, untouched = columns
    place = np.clip(row[..., at], np.float32(NEAREST_END), np.float32(1.0 - NEAREST_END))
    depth = np.float32(4.0) * place * (np.float32(1.0) - place)
    both = np.stack([row[..., pitch], row[..., rest]], axis=-1) - reference[..., untouched, None]
    roots = np.sign(both) * np.sqrt(np.abs(both) / depth[..., None])
    inputs = np.concatenate([np.arcsinh(both / np.float32(KNEE)), roots, depth[..., None]], axis=-1)
    return (inputs * (reference[..., -1:] > 0.0)).astype(np.float32)
