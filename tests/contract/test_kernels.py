"""A cached kernel calls only kernels of its own file.

numba's cache looks at the file that a kernel stands in. A kernel inlined from another file would go on in its
old form after that file has changed, and nothing would say so.
"""

import pkgutil
from importlib import import_module

import pytest
from numba.core.caching import NullCache
from numba.core.registry import CPUDispatcher

import monochord

MODULES = [module.name for module in pkgutil.walk_packages(monochord.__path__, "monochord.")]


@pytest.mark.parametrize("name", MODULES)
def test_cached_kernels_stand_in_one_file_with_what_they_call(name: str) -> None:
    kernels = {
        key: value for key, value in vars(import_module(name)).items() if isinstance(value, CPUDispatcher)
    }
    cached = [
        key
        for key, kernel in kernels.items()
        if kernel.py_func.__module__ == name and not isinstance(getattr(kernel, "_cache"), NullCache)  # noqa: B009
    ]
    foreign = [key for key, kernel in kernels.items() if kernel.py_func.__module__ != name]
    assert not (cached and foreign), f"{cached} may inline {foreign}"
