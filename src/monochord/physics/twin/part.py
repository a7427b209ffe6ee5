"""How the parts of the twin are compiled, and what lets their kernel be cached.

Each part of the sensor stands in a file of its own, as plain functions that numba inlines into one kernel.
numba's cache looks at the kernel's own file only, so that a part inlined from another would go on in its old
form after a change. The kernel therefore carries `fingerprint` of every part in its cache key.
"""

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])

COMPILE: Any = njit
"""numba's stubs know neither all of its options nor that a function keeps its signature."""
FAST = {"reassoc", "contract", "arcp", "nsz"}
"""Sums over modes may be reordered and products fused; NaN and infinity keep their meaning."""


def part(function: Function) -> Function:
    """Compile a function that is inlined into the kernel; it is not cached by itself.

    Examples
    --------
    >>> part(lambda x: x + 1.0)(2.0)
    3.0
    """
    return COMPILE(fastmath=FAST, error_model="numpy", inline="always")(function)


def called(function: Function) -> Function:
    """Compile a function that the kernel calls: one that runs seldom, or has no rows of modes to run along.

    Examples
    --------
    >>> called(lambda x: x + 1.0)(2.0)
    3.0
    """
    return COMPILE(fastmath=FAST, error_model="numpy", _nrt=False)(function)


def fingerprint(modules: Iterable[ModuleType]) -> int:
    """Return a number that changes with the text of any of the modules, below 2^62.

    Examples
    --------
    >>> import math, monochord.core.units
    >>> fingerprint([monochord.core.units]) == fingerprint([monochord.core.units])
    True
    """
    digest = hashlib.sha256()
    for module in modules:
        digest.update(Path(str(module.__file__)).read_bytes())
    return int.from_bytes(digest.digest()[:8], "big") >> 2
