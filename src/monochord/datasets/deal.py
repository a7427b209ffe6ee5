"""Dealing whole groups out to parts by given shares."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats


def deal(
    sizes: Sequence[int] | NDArray[np.int64],
    strata: Sequence[str],
    fractions: Sequence[float],
    stream: np.random.Generator,
) -> NDArray[np.int64]:
    """Return the part of every group, such that the parts come near their shares, in each stratum too.

    The groups of each stratum are taken in an order drawn at random, the largest strata first. Each goes to
    the part that lacks most in this stratum and, half as much, in all, as shares of the sizes dealt out
    with it.

    Parameters
    ----------
    sizes
        Of the groups (n,).
    strata
        What each group is one of (n,).
    fractions
        The share of each part; the sum is 1.
    stream
        What the order is drawn from.

    Returns
    -------
    NDArray[np.int64]
        Numbers of parts (n,). Parts whose share is above zero get a group each, where there are enough.

    Examples
    --------
    >>> part = deal([5] * 20, ["a", "b"] * 10, (0.8, 0.2), np.random.default_rng(0))
    >>> [int(((part == 1) & (np.arange(20) % 2 == kind)).sum()) for kind in (0, 1)]
    [2, 2]
    """
    weight, share = np.asarray(sizes, np.float64), np.asarray(fractions, np.float64)
    part = np.full(len(weight), -1, np.int64)
    total = np.zeros(len(share))
    names = np.asarray(strata)
    found, counts = np.unique(names, return_counts=True) if len(names) else (names, np.zeros(0, int))
    for stratum in found[np.argsort(-counts, kind="stable")]:
        here = np.zeros(len(share))
        for group in stream.permutation(np.flatnonzero(names == stratum)).tolist():
            coming = float(weight[group])
            lacks = _lack(here, share, coming) + 0.5 * _lack(total, share, coming)
            chosen = int(np.where(share > 0.0, lacks, -np.inf).argmax())
            part[group] = chosen
            here[chosen] += coming
            total[chosen] += coming
    _fill_empty(part, share, weight)
    return part


def _lack(held: Floats, share: Floats, coming: float) -> Floats:
    """Return how much each part lacks of its share of what is dealt out, the coming group included."""
    due = share * (held.sum() + coming)
    return (due - held) / max(held.sum() + coming, 1.0)


def _fill_empty(part: NDArray[np.int64], share: Floats, weight: Floats) -> None:
    """Give a part that got nothing the smallest group of the part that has most, while one has two."""
    for empty in np.flatnonzero(share > 0.0).tolist():
        held = np.bincount(part, minlength=len(share))
        if held[empty] or held.max(initial=0) < 2:
            continue
        givers = np.flatnonzero(part == held.argmax())
        part[givers[weight[givers].argmin()]] = empty
