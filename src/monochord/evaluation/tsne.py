"""Many columns drawn as a plane in which neighbours stay neighbours: t-SNE."""

from math import log

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats

COMPONENTS = 50
"""Principal components that distances are told from."""
EXAGGERATION, EXAGGERATED = 12.0, 250
"""How much neighbours attract each other more at first, and for how many steps."""
MOST_ROWS = 5000
"""Memory and time grow with the square: 5000 rows hold a few matrices of 200 MB."""


def tsne(rows: Floats, *, perplexity: float = 30.0, steps: int = 750) -> Floats:
    """Return places in a plane (n, 2) such that rows that are alike stand together.

    Minimises the divergence of the affinities q of the places, in Student's distribution of one degree of
    freedom, from those of the rows, p of `affinities`, by gradient descent with momentum. Columns are scaled
    to one standard deviation first and the first 50 principal components are used; it begins with the first
    two of them, so that the same rows give the same places. Neighbourhoods mean something; distances between
    groups, their sizes and the axes do not.

    Parameters
    ----------
    rows
        (n, columns), finite, of any unit; a column that never varies is left out.
    perplexity
        About how many neighbours a row has; above 1, and below a third of the rows.
    steps
        Of the descent, 250 or more.

    Raises
    ------
    InputError
        If rows are too few, too many or not numbers, or another argument is out of its range.

    References
    ----------
    van der Maaten and Hinton (2008), Visualizing data using t-SNE, J. Machine Learning Research 9, 2579;
    Kobak and Berens (2019), The art of using t-SNE for single-cell transcriptomics, Nature Communications 10,
    5416, for where to begin and how fast.

    Examples
    --------
    >>> tsne(np.random.default_rng(0).normal(size=(20, 3)), perplexity=5.0, steps=250).shape
    (20, 2)
    """
    rows = np.asarray(rows, np.float64)
    if rows.ndim != 2 or not np.isfinite(rows).all():
        raise InputError(f"rows of shape {rows.shape}", "(n, columns) of numbers")
    if len(rows) > MOST_ROWS:
        raise InputError(f"{len(rows)} rows", f"{MOST_ROWS} at most", "draw some of them")
    if steps < EXAGGERATED:
        raise InputError(f"{steps} steps", f"{EXAGGERATED} or more")
    components = _components(rows)
    likeness = affinities(components, perplexity)
    joint = np.maximum((likeness + likeness.T) / (2.0 * len(rows)), 1e-12)
    places = 1e-4 * components[:, :2] / max(float(components[:, 0].std()), 1e-300)
    rate = max(len(rows) / EXAGGERATION, 50.0)
    move, gain = np.zeros_like(places), np.ones_like(places)
    for step in range(steps):
        pulled = joint * (EXAGGERATION if step < EXAGGERATED else 1.0)
        near = 1.0 / (1.0 + _squares(places))
        np.fill_diagonal(near, 0.0)
        force = (pulled - near / near.sum()) * near
        slope = 4.0 * (force.sum(axis=1)[:, None] * places - force @ places)
        gain = np.maximum(np.where(slope * move < 0.0, gain + 0.2, 0.8 * gain), 0.01)
        move = (0.5 if step < EXAGGERATED else 0.8) * move - rate * gain * slope
        places = places + move
        places -= places.mean(axis=0)
    return places


def affinities(rows: Floats, perplexity: float) -> Floats:
    """Return how much each row takes each other for a neighbour (n, n): rows of the result sum to 1.

    p[j | i] is proportional to exp(-b[i] d[i, j]^2), 0 for j = i, with b[i] such that the entropy of each row
    is the logarithm of `perplexity`.

    Raises
    ------
    InputError
        If the perplexity is not above 1 and below a third of the rows.

    Examples
    --------
    >>> rows = np.array([[0.0], [1.0], [2.0], [9.0], [10.0], [11.0], [30.0]])
    >>> affinities(rows, 2.0).sum(axis=1).round(9).tolist()
    [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    """
    if not 1.0 < perplexity < len(rows) / 3.0:
        raise InputError(f"perplexity {perplexity:g}", f"above 1, below a third of {len(rows)} rows")
    square = _squares(rows)
    np.fill_diagonal(square, np.inf)
    square -= square.min(axis=1, keepdims=True)
    np.fill_diagonal(square, 0.0)
    low, high = np.zeros(len(rows)), np.full(len(rows), np.inf)
    sharp = 1.0 / np.maximum(square.mean(axis=1), 1e-300)
    likeness = square
    for _ in range(100):
        weight = np.exp(-sharp[:, None] * square)
        np.fill_diagonal(weight, 0.0)
        total = weight.sum(axis=1)
        likeness = weight / total[:, None]
        entropy = np.log(total) + sharp * (likeness * square).sum(axis=1)
        wide = entropy > log(perplexity)
        low, high = np.where(wide, sharp, low), np.where(wide, high, sharp)
        sharp = np.where(np.isinf(high), 2.0 * sharp, 0.5 * (low + high))
        if np.abs(entropy - log(perplexity)).max() < 1e-6:
            break
    return likeness


def _components(rows: Floats) -> Floats:
    varied = rows[:, np.ptp(rows, axis=0) > 0.0] if len(rows) else rows
    if varied.shape[1] == 0:
        raise InputError(f"{len(rows)} rows that are all alike", "rows that differ")
    scaled = (varied - varied.mean(axis=0)) / varied.std(axis=0)
    left, size, right = np.linalg.svd(scaled, full_matrices=False)
    # The sign of a component is the linear algebra library's choice; this one is ours.
    sign = np.sign(right[np.arange(len(right)), np.abs(right).argmax(axis=1)])
    found = (left * size * sign)[:, :COMPONENTS]
    return found if found.shape[1] > 1 else np.column_stack([found, np.zeros(len(rows))])


def _squares(rows: Floats) -> Floats:
    norm = np.sum(rows * rows, axis=1)
    return np.maximum(norm[:, None] + norm - 2.0 * (rows @ rows.T), 0.0)
