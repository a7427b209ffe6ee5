"""How the parts of the twin are compiled, and how their kernel is cached.

The parts are plain functions that are inlined into one kernel. numba's cache watches the kernel's own file
only: a part inlined from another file would stay as it was after a change. The kernel therefore carries the
`fingerprint` of every file in its cache key.
"""

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from monochord.core.kernels import compile_lazily, kernel

Function = TypeVar("Function", bound=Callable[..., Any])

CACHED: Any = kernel
"""Compiles the kernel itself, which alone is kept on disk."""
FAST = {"reassoc", "contract", "arcp", "nsz"}
"""Sums over modes may be reordered and products fused; NaN and infinity keep their meaning.

What is reordered depends on the code around it: to inline a part in another way changes the last bit of
results."""


def inlined(function: Function) -> Function:
    """Compile a function that LLVM inlines into its caller.

    LLVM, not numba (``inline="always"``), which takes twice as long: each part is typed once and alone. A
    number of modes that is known where the kernel is made still reaches it as a constant, so that LLVM
    unrolls its loops; the kernel is as fast.

    >>> inlined(lambda x: x + 1.0)(2.0)
    3.0
    """
    return compile_lazily(function, fastmath=FAST, forceinline=True, _nrt=False)


def called(function: Function) -> Function:
    """Compile a function that the kernel calls: one that runs seldom, or has no loop over modes.

    >>> called(lambda x: x + 1.0)(2.0)
    3.0
    """
    return compile_lazily(function, fastmath=FAST, _nrt=False)


def fingerprint(modules: Iterable[ModuleType]) -> int:
    """Return a number that changes with the text of any of the modules, below 2^62.

    >>> import math, monochord.core.units
    >>> fingerprint([monochord.core.units]) == fingerprint([monochord.core.units])
    True
    """
    digest = hashlib.sha256()
    for module in modules:
        digest.update(Path(str(module.__file__)).read_bytes())
    return int.from_bytes(digest.digest()[:8], "big") >> 2
