"""What a kernel costs to compile, and its cache on disk: what is damaged is compiled again and replaced."""

import subprocess
import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core import event

from monochord.core.kernels import kernel, part
from monochord.core.types import Floats

MODULE = """
from monochord.core.kernels import kernel

@kernel()
def twice(x: float) -> float:
    return 2.0 * x

def compilations():
    assert twice(1.5) == 3.0
    return sum(twice.stats.cache_misses.values())

if __name__ == "__main__":
    print(compilations())
"""
Damage = Callable[[bytes], bytes]
DAMAGES: dict[str, Damage] = {
    "empty": lambda _: b"",
    "truncated": lambda content: content[: len(content) // 2],
    "a bit flipped": lambda content: content[:200] + bytes([content[200] ^ 4]) + content[201:],
}


@pytest.fixture
def module(tmp_path: Path) -> Path:
    file = tmp_path / "doubling.py"
    file.write_text(MODULE, encoding="utf-8")
    assert compilations(file) == 1
    return file


def compilations(file: Path) -> int:
    """Load the module anew, and return how often its kernel was compiled for its first call."""
    spec = spec_from_file_location(file.stem, file)
    assert spec
    assert spec.loader
    loaded = module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded.compilations()


def test_a_whole_cache_is_used_in_another_process(tmp_path: Path) -> None:
    (tmp_path / "doubling.py").write_text(MODULE, encoding="utf-8")
    command = [sys.executable, "doubling.py"]
    for expected in ("1\n", "0\n"):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout, done.stderr) == (0, expected, "")


def test_a_kernel_is_compiled_again_when_what_it_calls_in_another_file_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inner, middle, outer = (tmp_path / f"{name}_of_a_chain.py" for name in ("inner", "middle", "outer"))
    start = "from monochord.core.kernels import kernel, part\n"
    call = "from inner_of_a_chain import factor\n@part()\ndef times(x): return factor() * x\n"
    middle.write_text(start + call, encoding="utf-8")
    outer.write_text(
        "from middle_of_a_chain import times\n" + MODULE.replace("2.0 * x", "times(x)"), encoding="utf-8"
    )
    monkeypatch.syspath_prepend(tmp_path)
    for factor, expected in (("2.0", 1), ("2.0", 0), ("4.0 / 2.0", 1), ("4.0 / 2.0", 0)):
        inner.write_text(f"{start}@part()\ndef factor(): return {factor}\n", encoding="utf-8")
        for name in (inner.stem, middle.stem):
            monkeypatch.delitem(sys.modules, name, raising=False)
        assert compilations(outer) == expected


def test_a_kernel_is_compiled_again_when_a_class_that_it_takes_is_renamed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    classes, file = tmp_path / "classes_of_a_kernel.py", tmp_path / "taking.py"
    monkeypatch.syspath_prepend(tmp_path)
    for name, expected in (("Factor", 1), ("Factor", 0), ("Multiplier", 1), ("Multiplier", 0)):
        text = f"from typing import NamedTuple\nclass {name}(NamedTuple):\n    value: float\n"
        classes.write_text(text, encoding="utf-8")
        text = MODULE.replace("(x: float)", "(x, by)").replace("2.0 * x", "by.value * x")
        text = text.replace("twice(1.5)", f"twice(1.5, {name}(2.0))")
        file.write_text(f"from {classes.stem} import {name}\n{text}", encoding="utf-8")
        monkeypatch.delitem(sys.modules, classes.stem, raising=False)
        assert compilations(file) == expected


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_a_damaged_file_is_replaced(module: Path, suffix: str) -> None:
    assert compilations(module) == 0
    for damage in DAMAGES.values():
        (file,) = module.parent.rglob(f"*.{suffix}")
        file.write_bytes(damage(file.read_bytes()))
        assert [compilations(module), compilations(module)] == [1, 0]


def test_what_cannot_be_written_is_compiled_all_the_same(module: Path) -> None:
    (index,) = module.parent.rglob("*.nbi")
    index.unlink()
    index.mkdir()  # what a file cannot replace, even for the superuser
    assert compilations(module) == 1


def test_what_numba_has_of_its_own_is_compiled_once_for_kernels_and_their_parts() -> None:
    @part()
    def middle(values: Floats) -> float:
        return float(np.median(values))

    @kernel()
    def above(values: Floats) -> float:
        return np.median(values[1:]) - middle(values) + np.zeros(2)[0]

    values: Any = np.arange(5, dtype=np.int16)  # a type that no other kernel of this process has compiled for
    with event.install_recorder("numba:compile") as recorded:
        assert above(values) == 0.5
    ends = [one.data for _, one in recorded.buffer if one.is_end]
    compiled = [(data["dispatcher"].py_func.__qualname__, data["args"]) for data in ends]
    assert len(compiled) > 5
    assert sorted({*map(str, compiled)}) == sorted(map(str, compiled))


def test_a_part_runs_uncompiled_where_python_calls_it() -> None:
    @part()
    def first(values: Floats) -> float:
        return values[0]

    @kernel()
    def doubled(values: Floats) -> float:
        return 2.0 * first(values)

    assert doubled(np.array([1.5])) == 3.0
    assert first(np.array([1.5])) == 1.5
    with pytest.raises(IndexError):
        first(np.zeros(0))
