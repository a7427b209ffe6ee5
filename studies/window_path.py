"""The code that one window passes through in a model: files, functions, compiled kernels, calls and moves.

Prints median and maximum over the windows of a simulated take, in some twenty seconds:
``python -m studies.window_path``.
"""

import json
import sys
from collections.abc import Callable
from itertools import chain, islice
from pathlib import Path
from statistics import median
from types import CodeType, FrameType, FunctionType
from typing import Any, TypeAlias

import click
from studies._command import lines_of, main

import monochord as mc
from monochord.capture.sources import SOURCES
from monochord.core.windows import windows

PACKAGE = f"{Path(mc.__file__).parent}/"
WARM_UP = 20
"""Windows before the count, in which modules are imported and kernels compiled."""
COMPREHENSIONS = {"<lambda>", "<listcomp>", "<genexpr>", "<dictcomp>", "<setcomp>"}
"""Code that belongs to the function around it."""
Name: TypeAlias = tuple[str, str]
"""A function by file and qualified name; the hash of a code object changes while it runs."""


def counts_of(work: Callable[[], object]) -> dict[str, int]:
    """Return the counts of a call.

    `files`, `functions` and `kernels` are distinct ones of the package; a kernel counts with all kernels that
    it calls. `calls` are all Python calls, those of other packages included, and `moves` the calls from one
    file of the package to another.
    """
    modules = [vars(module).values() for name, module in sys.modules.items() if name.startswith("monochord.")]
    known = {_name(each.py_func.__code__): each for each in chain(*modules) if _is_kernel(each)}
    functions, kernels, stack, calls, moves = set[Name](), set[Name](), [""], 0, 0

    def note(frame: FrameType, event: str, _: object) -> None:
        nonlocal calls, moves
        code, last = frame.f_code, stack[-1]
        if event == "return" and len(stack) > 1:
            stack.pop()
        if event != "call":
            return
        is_own, calls = code.co_filename.startswith(PACKAGE), calls + 1
        stack.append(code.co_filename if is_own else last)
        moves += is_own and last not in {"", code.co_filename}
        if _name(code) in known:
            kernels.update(_called(known[_name(code)]))
        elif is_own and code.co_name not in COMPREHENSIONS:
            functions.add(_name(code))

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    files = {file for file, _ in functions | kernels}
    found = {"files": len(files), "functions": len(functions), "kernels": len(kernels)}
    return {**found, "calls": calls, "moves": moves}


def _is_kernel(value: Any) -> bool:
    return isinstance(getattr(value, "py_func", None), FunctionType)


def _name(code: CodeType) -> Name:
    return code.co_filename, code.co_qualname


def _called(kernel: Any) -> set[Name]:
    """Return a kernel and those that it calls."""
    waiting, seen = [kernel], set[Name]()
    while waiting:
        function: FunctionType = waiting.pop().py_func
        code = function.__code__
        if _name(code) not in seen:
            seen.add(_name(code))
            used = [function.__globals__.get(name) for name in code.co_names]
            cells = [cell.cell_contents for cell in function.__closure__ or ()]
            waiting += filter(_is_kernel, used + cells)
    return seen


def window_paths(model: str, count: int) -> dict[str, list[dict[str, int]]]:
    """Return the counts of each window of a take: those wholly untouched, and those wholly touched."""
    loaded, result = mc.load(model), dict[str, list[dict[str, int]]](untouched=[], touched=[])
    size, hop, rate = (getattr(loaded.definition, name) for name in ("window", "hop", "sample_rate"))
    with SOURCES.build("twin", {"speed": 0.0, "seed": 1, "sample_rate": rate}).open() as source:
        step, cut = loaded.stream(source.signal, size), windows(source, size=size, hop=hop, sample_rate=rate)
        for window in islice(cut, WARM_UP):
            step(window)
        for window in islice(cut, count):
            counts = counts_of(lambda window=window: step(window))
            contact = source.truth(window.start, window.start + size).get("contact")
            if contact in {0.0, 1.0}:
                result["touched" if contact else "untouched"].append(counts)
    return result


@click.command(name="window_path", help=__doc__)
@click.option("--model", default="demo", show_default=True, help="Folder or name of the model.")
@click.option("--windows", "count", default=400, show_default=True, help="Number of windows.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(model: str, count: int, as_json: bool) -> None:  # noqa: FBT001
    """Print the table of a model."""
    paths = {kind: rows for kind, rows in window_paths(model, count).items() if rows}
    table = {
        f"{kind} {way.__name__}": {name: way(row[name] for row in rows) for name in rows[0]}
        for kind, rows in paths.items()
        for way in (median, max)
    }
    if as_json:
        print(json.dumps({"windows": {kind: len(rows) for kind, rows in paths.items()}, **table}, indent=1))
    else:
        rows = [(name, *(f"{value:g}" for value in row.values())) for name, row in table.items()]
        print(*lines_of(("one window", *next(iter(table.values()), ())), rows), sep="\n")


if __name__ == "__main__":
    main(command)
