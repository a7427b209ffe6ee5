"""Confidence intervals of scores by the block bootstrap, since neighbouring windows are similar."""

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.metrics._checked import numbers

Rows = NDArray[np.int64]


def time_blocks(group: NDArray[Any], time: Floats, length: Seconds) -> NDArray[np.int64]:
    """Return each row's block number (n,): stretches of `length` within a group, from 0 on.

    Parameters
    ----------
    group
        Group of each row, such as its session, (n,): numbers or names.
    time
        Time of each row in its group, (n,), in s.
    length
        Length of a block, in s, above 0: longer than the correlation between neighbours.

    Raises
    ------
    InputError
        If the shapes differ, a time is not finite, or `length` is not above 0.

    Examples
    --------
    >>> time_blocks(np.array(["a", "a", "a", "b"]), np.array([0.0, 0.5, 1.5, 0.0]), 1.0).tolist()
    [0, 0, 1, 2]
    """
    groups = np.unique(np.asarray(group), return_inverse=True)[1].astype(np.float64)
    groups, time = numbers(group=groups, time=time)
    if not length > 0.0:
        raise InputError(f"blocks of {length:g} s", "above 0 s")
    cells = np.column_stack([groups, np.floor(time / length)])
    return np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)


def bootstrap_interval(
    statistic: Callable[[Rows], float],
    blocks: NDArray[Any],
    *,
    seed: int,
    draws: int = 1000,
    share: float = 0.95,
) -> tuple[float, float]:
    """Return the confidence interval of a row statistic, by resampling whole blocks with replacement.

    It is the expanded percentile interval: the draws' quantiles at Phi(-+ sqrt(m / (m - 1)) t), with
    Student's t of m - 1 degrees of freedom for m blocks, instead of Phi(-+ z); so few blocks give no false
    confidence. It assumes that blocks are independent and represent the population; below ten blocks it is a
    rough guide.

    Parameters
    ----------
    statistic
        Function from row indices (k,), with repetitions, to a number. A draw is left out where it raises
        `InputError` or returns NaN, as the area under the curve does for a single class.
    blocks
        Block of each row, (n,): numbers or names, such as sessions, or the result of `time_blocks`.
    seed
        Random seed.
    draws
        Number of draws.
    share
        Coverage of the interval, between 0 and 1.

    Returns
    -------
    tuple of float
        Low and high, in the statistic's unit.

    Raises
    ------
    InputError
        If there are fewer than 2 blocks, or more than half of the draws fail.

    References
    ----------
    Hesterberg (2015), What teachers should know about the bootstrap, The American Statistician 69, 371;
    Kuensch (1989), The jackknife and the bootstrap for general stationary observations, Annals of Statistics
    17, 1217.

    Examples
    --------
    >>> error = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 3.5])
    >>> session = np.array([0, 0, 1, 1, 2, 2])
    >>> low, high = bootstrap_interval(lambda rows: float(error[rows].mean()), session, seed=0)
    >>> low, high
    (1.25, 3.25)
    """
    blocks = np.asarray(blocks)
    if blocks.ndim != 1:
        raise InputError(f"blocks of shape {blocks.shape}", "one dimension")
    _, which = np.unique(blocks, return_inverse=True)
    order = np.argsort(which, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(which))[:-1]) if blocks.size > 0 else []
    count = len(members)
    if count < 2:
        raise InputError(f"{count} blocks", "2 or more", "use more sessions, or shorter blocks")
    if not (0.0 < share < 1.0 and draws >= 10):
        raise InputError(f"{draws} draws, share {share:g}", "10 or more draws, a share between 0 and 1")
    stream = np.random.default_rng(seed)
    values: list[float] = []
    for _ in range(draws):
        drawn = stream.integers(count, size=count).tolist()
        try:
            value = statistic(np.concatenate([members[block] for block in drawn]))
        except InputError:
            continue
        if not np.isnan(value):
            values.append(value)
    if len(values) < 0.5 * draws:
        raise InputError(
            f"a statistic undefined in {draws - len(values)} of {draws} draws", "half of them at most"
        )
    low, high = np.quantile(values, _levels(count, share)).tolist()
    return low, high


def _levels(blocks: int, share: float) -> tuple[float, float]:
    from scipy.special import ndtr, stdtrit  # noqa: PLC0415

    tail = 0.5 - 0.5 * share
    level = float(ndtr(sqrt(blocks / (blocks - 1.0)) * stdtrit(blocks - 1.0, tail)))
    return level, 1.0 - level
