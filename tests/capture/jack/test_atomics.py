from typing import Any

import numpy as np
from numba import njit

from monochord.capture.jack.atomics import load, store


def test_a_stored_number_is_loaded_and_its_neighbours_stay() -> None:
    numbers = np.arange(4)
    store(numbers, 2, -(2**62))
    assert load(numbers, 2) == -(2**62)
    assert numbers.tolist() == [0, 1, -(2**62), 3]


def test_they_compile_to_ordered_instructions() -> None:
    # The compiled code of a cached function cannot be read back, so compile afresh.
    load_ir, store_ir = (afresh(function) for function in (load, store))
    assert "load atomic i64" in load_ir
    assert "acquire" in load_ir
    assert "store atomic i64" in store_ir
    assert "release" in store_ir


def afresh(function: Any) -> str:
    compiled: Any = njit(function.py_func)
    compiled(*(np.arange(4), 1, 2)[: function.py_func.__code__.co_argcount])
    return "".join(compiled.inspect_llvm().values())
