"""A cached kernel calls only kernels of its own file, or is told when the others change.

numba's cache looks at the file that a kernel stands in. A kernel inlined from another file would go on in its
old form after that file has changed, and nothing would say so. The twin's kernel is made of parts in many
files; the key of its cache carries a fingerprint of their text.
"""

import ast
import pkgutil
import sys
from importlib import import_module
from pathlib import Path

import pytest
from numba.core.caching import NullCache
from numba.core.registry import CPUDispatcher

import monochord
from monochord.physics.twin import jit, kernel

MODULES = [module.name for module in pkgutil.walk_packages(monochord.__path__, "monochord.")]
TWIN = "monochord.physics.twin."


def compiled(name: str) -> dict[str, CPUDispatcher]:
    return {
        key: value for key, value in vars(import_module(name)).items() if isinstance(value, CPUDispatcher)
    }


def is_cached(function: CPUDispatcher) -> bool:
    return not isinstance(getattr(function, "_cache"), NullCache)  # noqa: B009


@pytest.mark.parametrize("name", MODULES)
def test_cached_kernels_stand_in_one_file_with_what_they_call(name: str) -> None:
    kernels = compiled(name)
    cached = [
        key
        for key, function in kernels.items()
        if function.py_func.__module__ == name and is_cached(function)
    ]
    foreign = [key for key, function in kernels.items() if function.py_func.__module__ != name]
    assert not (cached and foreign), f"{cached} may inline {foreign}"


def reached(name: str) -> set[str]:
    """The twin's modules with compiled parts that a module imports, and theirs in turn."""
    reached_modules = {name}
    waiting = [name]
    while waiting:
        tree = ast.parse(Path(str(import_module(waiting.pop()).__file__)).read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith(TWIN.rstrip(".")):
                continue
            module = str(node.module)
            names = [module] if module != TWIN.rstrip(".") else [TWIN + alias.name for alias in node.names]
            new = {other for other in names if other in sys.modules} - reached_modules
            reached_modules |= new
            waiting += sorted(new)
    return reached_modules


def test_the_fingerprint_covers_all_that_the_twins_kernel_is_made_of() -> None:
    made_of = reached(kernel.__name__)
    parts = {name for name in MODULES if name.startswith(TWIN) and compiled(name)}
    assert {TWIN + "contact", TWIN + "string", TWIN + "roughness"} <= parts
    assert parts <= made_of
    assert made_of == {module.__name__ for module in kernel.FILES}
    assert jit.fingerprint(kernel.FILES) == kernel.FINGERPRINT


def test_only_the_kernel_of_the_twin_calls_its_parts() -> None:
    twins = [name for name in MODULES if name.startswith(TWIN)]
    assert not [name for name in twins for one in compiled(name).values() if is_cached(one)]
    others = [one for name in MODULES if not name.startswith(TWIN) for one in compiled(name).values()]
    assert not [one for one in others if one.py_func.__module__.startswith(TWIN)]
