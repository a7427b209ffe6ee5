"""Checks the shape of sound before it reaches compiled kernels.

A kernel trusts the shapes of its arrays and would read beyond the end of a shorter one. So everything that
takes sound from a caller (a `Window`, a batch of windows, an analyser) checks it here once; arrays computed
from it inside the package have the right shapes.
"""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from monochord.core.errors import InputError

ANY = -1
"""Stands for any length from 1 on in a shape."""
NUMBERS = "fiub"
"""Data type kinds that are ordered numbers."""

Real = TypeVar("Real", np.float32, np.float64)


def sound(
    samples: ArrayLike, channels: int = ANY, size: int = ANY, dtype: type[Real] = np.float32
) -> NDArray[Real]:
    """Return sound (channels, frames), contiguous and of a type that kernels are compiled for.

    Sound already in this form is returned without a copy.

    Parameters
    ----------
    samples
        Sound in full scale; numbers of any type.
    channels, size
        Expected numbers of channels and frames; by default any number from 1 on.
    dtype
        Type of the samples returned.

    Raises
    ------
    InputError
        If the shape is wrong, or the values are not numbers.

    Examples
    --------
    >>> sound([[0, 1, 0]]).dtype
    dtype('float32')
    >>> sound(np.zeros((1, 4410)), channels=2)
    Traceback (most recent call last):
    ...
    monochord.core.errors.InputError: one microphone: expected two microphones; record both
    """
    array = _numbers(samples, dtype)
    if array.ndim != 2 or 0 in array.shape:
        remedy = "use one row per channel" if array.ndim == 1 else ""
        raise InputError(f"sound of shape {array.shape}", "(channels, frames), one or more of each", remedy)
    if channels != ANY:
        refuse_other_channels(array.shape[0], channels)
    if size not in (ANY, array.shape[1]):
        raise InputError(f"a window of {array.shape[1]} frames", f"{size} frames")
    return array


def refuse_other_channels(count: int, expected: int, reader: str = "") -> None:
    """Raise `InputError` unless `count` channels fit the `reader`, such as "for a model".

    >>> refuse_other_channels(1, 2, "for a model")
    Traceback (most recent call last):
    ...
    monochord.core.errors.InputError: one microphone for a model: expected two microphones; record both
    """
    if count != expected:
        one = "record both" if (count, expected) == (1, 2) else "choose the string's channels"
        raise InputError(f"{_microphones(count)} {reader}".strip(), _microphones(expected), one)


def batch(windows: ArrayLike, channels: int, size: int) -> NDArray[np.float32]:
    """Return windows (n, channels, size), each as `sound` returns it; n may be 0.

    Raises
    ------
    InputError
        If the shape is wrong, or the values are not numbers.

    Examples
    --------
    >>> batch(np.zeros((0, 2, 4410)), 2, 4410).shape
    (0, 2, 4410)
    """
    array = _numbers(windows, np.float32)
    if array.ndim != 3 or array.shape[1:] != (channels, size):
        raise InputError(f"windows of shape {array.shape}", f"(n, {channels}, {size})")
    return array


def alike(name: str, *arrays: NDArray[Any]) -> None:
    """Raise `InputError` unless the arrays have the same, nonempty shape; `name` describes them.

    >>> alike("spectrum", np.ones(3), np.ones(2))
    Traceback (most recent call last):
    ...
    monochord.core.errors.InputError: spectrum of shapes (3,) and (2,): expected one shape, not empty
    """
    shapes = [array.shape for array in arrays]
    if len({*shapes}) > 1 or 0 in shapes[0]:
        given = f"{name} of shapes {' and '.join(map(str, shapes))}"
        raise InputError(given, "one shape, not empty")


def _microphones(count: int) -> str:
    word = {1: "one", 2: "two"}.get(count, str(count))
    return f"{word} microphone{'s' * (count != 1)}"


def _numbers(given: ArrayLike, dtype: type[Real]) -> NDArray[Real]:
    """Return an array of numbers, contiguous; values beyond the type's range become infinite."""
    if isinstance(given, np.ndarray) and given.dtype == dtype and given.flags.c_contiguous:
        return given
    try:
        array = np.asarray(given)
    except ValueError as error:
        raise InputError("sound in rows of different lengths", "an array of numbers") from error
    if array.dtype.kind not in NUMBERS:
        raise InputError(f"sound of type {array.dtype}", "an array of numbers")
    with np.errstate(over="ignore"):
        return np.array(array, dtype, order="C")
