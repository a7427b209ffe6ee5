"""Checks the shape of sound before it reaches compiled kernels.

A kernel trusts the shapes of its arrays and would read beyond the end of a shorter one. So everything that
takes sound from a caller (a `Window`, a batch of windows, an analyser) checks it here once; arrays computed
from it inside the package have the right shapes.
"""

from typing import Any, TypeVar, cast

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

    Sound already in this form is returned without a copy; floats of other types are converted. By default
    channels and frames (`size`) are any number from 1 on. Raises `InputError` for another shape, for
    integers, and for what is no number.

    >>> sound([[0.0, 1.0, 0.0]]).dtype
    dtype('float32')
    >>> sound(np.zeros((1, 4410)), channels=2)
    Traceback (most recent call last):
    ...
    monochord.core.errors.InputError: one microphone: expected two microphones; record both
    """
    array = _sound(samples, dtype)
    if array.ndim != 2 or 0 in array.shape:
        remedy = "use one row per channel" if array.ndim == 1 else ""
        raise InputError(f"sound of shape {array.shape}", "(channels, frames), one or more of each", remedy)
    if channels != ANY:
        refuse_other_channels(array.shape[0], channels)
    if size not in (ANY, array.shape[1]):
        raise InputError(f"a window of {array.shape[1]} frames", f"{size} frames")
    return array


def is_sound(samples: Any) -> bool:
    """Return whether these are frames (channels, n) in the form that `frames` returns.

    >>> is_sound(np.zeros((2, 0), np.float32)), is_sound(np.zeros((2, 5)))
    (True, False)
    """
    return (
        type(samples) is np.ndarray
        and samples.ndim == 2
        and samples.dtype == np.float32
        and samples.flags.c_contiguous
        and len(samples) > 0
    )


def frames(samples: ArrayLike) -> NDArray[np.float32]:
    """Return frames (channels, n), each as `sound` returns it; n may be 0.

    >>> frames(np.zeros((2, 0))).shape
    (2, 0)
    """
    array = _sound(samples, np.float32)
    if array.ndim != 2 or not len(array):
        raise InputError(f"sound of shape {array.shape}", "(channels, frames), one or more channels")
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


def batch(windows: ArrayLike, channels: int = ANY, size: int = ANY) -> NDArray[np.float32]:
    """Return windows (n, channels, size), each as `sound` returns it; n may be 0.

    By default channels and size are any number from 1 on. Errors are those of `sound`.

    >>> batch(np.zeros((0, 2, 4410)), 2, 4410).shape
    (0, 2, 4410)
    """
    array = _sound(windows, np.float32)
    expected = f"(n, {'channels' if channels == ANY else channels}, {'frames' if size == ANY else size})"
    pairs = zip(array.shape[1:], (channels, size), strict=False)
    if array.ndim != 3 or not all(size > 0 if wanted == ANY else size == wanted for size, wanted in pairs):
        raise InputError(f"windows of shape {array.shape}", expected)
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


def numbers(given: ArrayLike, number: Any = Any, name: str = "array") -> NDArray[Any]:
    """Return an array of ordered numbers; one of the wanted type is returned unchanged.

    `Any` keeps the type of `given`. Floats beyond the range of the wanted type become infinite;
    ``np.float32`` is that of sound, which takes no whole numbers. Raises `InputError`, which calls the array
    `name`, if these are no numbers, of another type, or rows of different lengths.

    >>> numbers([0, 1], np.float64).dtype
    dtype('float64')
    >>> numbers([0.5], np.int64)
    Traceback (most recent call last):
    ...
    monochord.core.errors.InputError: array of float64: expected an array of int64
    """
    if isinstance(given, np.ndarray) and (
        given.dtype == number or (number is Any and given.dtype.kind in NUMBERS)
    ):
        return given
    try:
        array = np.asarray(given)
    except Exception as error:  # whatever its own conversion raises
        rows = "rows of different lengths" if isinstance(error, ValueError) else type(given).__name__
        raise InputError(f"{name} of {rows}", "an array of numbers") from error
    if array.dtype.kind not in NUMBERS:
        raise InputError(f"{name} of type {array.dtype}", "an array of numbers")
    if number is Any:
        return array
    if number is np.float32:  # the type of sound
        _refuse_whole(array)
    with np.errstate(over="ignore", invalid="ignore"):
        fitted = array.astype(np.dtype(cast("Any", number)))
    if fitted.dtype.kind not in "fb" and not np.array_equal(fitted, array):
        raise InputError(f"{name} of {array.dtype}", f"an array of {fitted.dtype}")
    return fitted


def _refuse_whole(array: NDArray[Any]) -> None:
    """Raise `InputError` for whole numbers, whose full scale is not 1."""
    if array.dtype.kind != "f" and array.size:
        remedy = "divide 16-bit samples by 32768"
        raise InputError(f"sound of type {array.dtype}", "float in full scale, -1 to 1", remedy)


def _sound(given: ArrayLike, dtype: type[Real]) -> NDArray[Real]:
    """Return sound of a type, contiguous; raises `InputError` for integers, whose full scale is not 1."""
    if isinstance(given, np.ndarray) and given.dtype == dtype and given.flags.c_contiguous:
        return given
    array = numbers(given, name="sound")
    _refuse_whole(array)
    with np.errstate(over="ignore"):
        return np.array(array, dtype, order="C")
