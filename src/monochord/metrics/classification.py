"""Accuracy of binary answers."""

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.metrics._checked import decisions


def confusion(reference: NDArray[np.bool_], estimate: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the confusion counts (2, 2): rows are the truth, columns the answer, no before yes.

    Parameters
    ----------
    reference, estimate
        Truth and answer, (n,) each: false and true, or 0 and 1.

    Raises
    ------
    InputError
        If shapes differ, an array is empty, or a value is neither; as in every metric here.

    Examples
    --------
    >>> confusion(np.array([True, True, False]), np.array([True, False, False])).tolist()
    [[1, 0], [1, 1]]
    """
    reference, estimate = decisions(reference=reference, estimate=estimate)
    return np.bincount(2 * reference.astype(np.int64) + estimate, minlength=4).astype(np.int64).reshape(2, 2)


def accuracy(reference: NDArray[np.bool_], estimate: NDArray[np.bool_]) -> float:
    """Return the share of correct answers, 0 to 1.

    If one class is rare, always answering the other class scores high: see `balanced_accuracy`.

    Parameters
    ----------
    reference, estimate
        Truth and answer, (n,) each: false and true, or 0 and 1.

    Examples
    --------
    >>> accuracy(np.array([True, True, False, False]), np.array([True, False, False, False]))
    0.75
    """
    counts = confusion(reference, estimate)
    return float(np.trace(counts) / counts.sum())


def balanced_accuracy(reference: NDArray[np.bool_], estimate: NDArray[np.bool_]) -> float:
    """Return the mean of the correct shares of yes and of no, 0 to 1; chance is one half.

    Parameters
    ----------
    reference, estimate
        Truth and answer, (n,) each: false and true, or 0 and 1. The truth must contain both.

    References
    ----------
    Brodersen, Ong, Stephan and Buhmann (2010), The balanced accuracy and its posterior distribution, Proc.
    20th Int. Conf. Pattern Recognition, 3121.

    Examples
    --------
    >>> balanced_accuracy(np.array([True, False, False, False]), np.array([True, True, False, False]))
    0.8333333333333333
    """
    counts = confusion(reference, estimate)
    if (counts.sum(axis=1) == 0).any():
        raise InputError(f"a truth with only {'no' if counts[0].any() else 'yes'}", "both yes and no")
    return float(np.mean(np.diag(counts) / counts.sum(axis=1)))
