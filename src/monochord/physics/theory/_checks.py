"""Argument checks of the closed forms, for numbers and arrays."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np

from monochord.core.errors import InputError
from monochord.core.lengths import metres_meant
from monochord.core.types import Floats

P = ParamSpec("P")
R = TypeVar("R")
Number = TypeVar("Number", float, Floats)
"""A float or an array of floats; the result is of the same kind."""


def representable(function: Callable[P, R]) -> Callable[P, R]:
    """Return a closed form that raises `InputError` where its numbers overflow, or have no result."""

    @wraps(function)
    def in_range(*args: P.args, **named: P.kwargs) -> R:
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                return function(*args, **named)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            name = function.__name__.replace("_", " ")
            raise InputError(
                f"{name} of numbers this extreme", "numbers whose result a float holds"
            ) from error
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            given = f"arrays for {function.__name__.replace('_', ' ')} that do not fit together"
            raise InputError(given, "numbers, or arrays of one shape") from error

    return in_range


def refuse_negative_force(force: float | Floats) -> None:
    """Raise `InputError` for a normal force below zero or not finite."""
    if not np.all(np.asarray(force) >= 0.0):
        raise InputError(f"force {_worst(force)} N", "0 N or more", "a touch presses; use a positive force")


def refuse_outside(position: float | Floats, length: float) -> None:
    """Raise `InputError` for a position not strictly between the ends of the string."""
    inside = (np.asarray(position) > 0.0) & (np.asarray(position) < length)
    if not np.all(inside):
        outside = np.asarray(position)[~inside].flat[0]
        given, expected = f"position {outside:g} m", f"strictly between 0 and {length:g} m"
        raise InputError(given, expected, metres_meant(float(outside)))


def refuse_not_positive(**named: float | Floats) -> None:
    """Raise `InputError` for a named quantity that is not above zero."""
    for name, value in named.items():
        if not np.all(np.asarray(value) > 0.0):
            raise InputError(f"{name.replace('_', ' ')} {_worst(value)}", "above 0")


def refuse_infinite(**named: float | Floats) -> None:
    """Raise `InputError` for a named quantity that is not above zero and finite."""
    refuse_not_positive(**named)
    for name, value in named.items():
        if not np.all(np.isfinite(value)):
            raise InputError(f"{name.replace('_', ' ')} inf", "a finite number")


def _worst(value: float | Floats) -> str:
    return f"{np.min(np.asarray(value)):g}"
