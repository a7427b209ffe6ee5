"""Kernels are entered with shapes that were checked, and a cached one is told when what it calls changes.

A kernel reads beyond the end of an array that is shorter than it expects. So every Python function that calls
one is listed here with who has checked its arrays, and every public entry is fed with sound of every shape.

numba's cache looks at the file that a kernel stands in. A kernel inlined from another file would go on in its
old form after that file has changed, and nothing would say so. So a kernel's cache also watches the files of
the kernels that its module imports by name (`tests/core/test_kernels.py`). The twin's kernel is made of parts
in many files, by their modules; the key of its cache carries a fingerprint of their text.
"""

import ast
import inspect
import json
import pkgutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from numba.core.caching import NullCache
from numba.core.ccallback import CFunc
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


def test_cached_kernels_call_those_of_other_files_by_name_alone() -> None:
    by_module: list[str] = []
    for name in MODULES:
        own = {key: one for key, one in compiled(name).items() if one.py_func.__module__ == name}
        if not any(is_cached(one) for one in own.values()):
            continue
        imported = {key for key, value in vars(import_module(name)).items() if inspect.ismodule(value)}
        used = {word for one in own.values() for word in one.py_func.__code__.co_names} & imported
        modules = [vars(import_module(name))[key].__name__ for key in used]
        by_module += [name for module in modules if module in MODULES and compiled(module)]
    assert not by_module, "a kernel kept on disk may inline one whose file its cache does not watch"


def test_what_is_kept_on_disk_is_checked_when_it_is_read() -> None:
    kept = [function for name in MODULES for function in compiled(name).values() if is_cached(function)]
    assert kept
    assert {type(getattr(each, "_cache")).__module__ for each in kept} == {"monochord.core.kernels"}  # noqa: B009


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


WHO_CHECKS = {
    "dsp.levels": {"measure_levels": "itself"},
    "dsp.microphones": dict.fromkeys(
        ("__init__", "_frequency", "_has_rest", "compare_inputs", "is_deaf"), "compare_inputs"
    ),
    "dsp.resample": {"_append": "itself"},
    "dsp.series": {"weigh": "itself"},
    "dsp.spectrum": {"power_spectrum": "itself", "find_peaks": "itself", "block_floors": "spectrum_of"},
    "perception.usable": {"unusable_reason": "Window", "__call__": "SpectrumAnalyser"},
    "perception.spectrum": {"spectrum_of": "itself", "relisted": "spectrum_of"},
    "perception.closed_form.lines": {"prominent_lines": "itself"},
    "perception.closed_form.both_segments": {"read": "prominent_lines"},
    "perception.features.fft_harmonic": {"row": "SpectrumAnalyser"},
    "perception.features.reading": {"row": "SpectrumAnalyser"},
    "perception.reader.cells": {"spectrum_cells": "SpectrumAnalyser"},
    "perception.reader.memory": {"recall": "SpectrumAnalyser"},
    "perception.reader.reader": dict.fromkeys(("alone", "inputs", "read"), "SpectrumAnalyser"),
    "perception.model.correction": {"terms": "itself", "error": "itself", "residual": "the kernel"},
    "perception.model.faults": {"step": "Definition.fault_columns"},
    "perception.model.network": {"outputs": "the kernel", "network_inputs": "itself"},
    "perception.training.regression": dict.fromkeys(("_left_out", "first"), "the kernel"),
    "perception.tuning.measurement": {"string_take": "Tuner"},
    "perception.tuning.pluck": {"_peaks": "itself"},
    "perception.tuning.lines": {"merged_lines": "spectrum_of", "lasting_lines": "merged_lines"},
    "perception.tuning.tuner": {"_tuning": "merged_lines"},
    "physics.split_string.stream": {"_ring_on": "SplitString"},
    "capture.jack.arena": {"count": "Arena"},
    "capture.jack.ring": dict.fromkeys(("pending", "put", "take"), "Ring"),
    "lab.jack_twin": {"write": "Ring"},
    "lab.player": {"_schedule": "Ring"},
}
"""Python functions that call a kernel, by module, and who has checked the arrays that they pass."""
NEVER = {"no channel", "empty", "one row", "words", "complex"}
REFUSED = {
    "two": NEVER | {"one channel", "three channels", "short", "huge"},
    "one": NEVER | {"plain", "float64", "strided", "Fortran order", "three channels", "short", "huge"},
    "size": NEVER | {"short", "huge"},
    "long": NEVER | {"one channel", "three channels", "short"},
    "any": NEVER,
}
"""Sound that an entry refuses, by the beginning of its name."""
SAME = ("float64", "strided", "Fortran order")
"""Sound that is the plain one in another form."""


def callers(name: str) -> set[str]:
    """The functions of a module that run in Python and call a kernel."""
    module = import_module(name)
    found: set[str] = set()

    def visit(node: ast.AST, function: str) -> None:
        for child in ast.iter_child_nodes(node):
            inside = function
            if isinstance(child, ast.FunctionDef):
                if isinstance(getattr(module, child.name, None), CPUDispatcher | CFunc) and not function:
                    continue
                inside = function or child.name
            if isinstance(child, ast.Call) and isinstance(called(module, child.func), CPUDispatcher):
                found.add(function)
            visit(child, inside)

    visit(ast.parse(inspect.getsource(module)), "")
    return found


def called(module: object, function: ast.expr) -> object:
    """What a call's name stands for in a module; None where it is no name."""
    if isinstance(function, ast.Attribute):
        home = called(module, function.value)
        return getattr(home, function.attr, None) if inspect.ismodule(home) else None
    return getattr(module, function.id, None) if isinstance(function, ast.Name) else None


def test_the_arrays_of_every_kernel_are_checked_by_someone() -> None:
    modules = [name for name in MODULES if not name.startswith(TWIN)]
    unlisted = {
        name: callers(name) - WHO_CHECKS.get(name.removeprefix("monochord."), {}).keys() for name in modules
    }
    assert not {name: functions for name, functions in unlisted.items() if functions}


@pytest.fixture(scope="module")
def outcomes() -> dict[str, dict[str, object]]:
    """What every public entry makes of every sound, as far as the process lived."""
    command = [sys.executable, "-m", "tests.contract.entries"]
    root = Path(__file__).parents[2]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=root)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, f"{lines[-1]}: {done.stderr[-2000:]}"
    results: dict[str, dict[str, object]] = {}
    for entry, sound, *back in lines:
        if back:
            results.setdefault(entry, {})[sound] = back[0]
    return results


def test_every_entry_refuses_what_its_kernels_cannot_read(outcomes: dict[str, dict[str, object]]) -> None:
    assert len(outcomes) >= 20
    for entry, results in outcomes.items():
        refused = {sound for sound, back in results.items() if back == "refused"}
        assert refused == REFUSED[entry.partition(":")[0]], entry


def test_sound_in_another_form_gives_the_same(outcomes: dict[str, dict[str, object]]) -> None:
    for entry, results in outcomes.items():
        assert [results[form] for form in SAME] == [results["plain"]] * len(SAME), entry
