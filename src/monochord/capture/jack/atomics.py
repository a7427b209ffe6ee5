"""Ordered loads and stores of one integer, for memory that two threads share without a lock.

The writer fills the data and then publishes an index with `store_release`; a reader that sees the index
through `load_acquire` also sees the data, on every processor.
"""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from monochord.core.kernels import kernel

ALIGNMENT = 8


def _in_kernels(function: Any) -> Any:
    """Make a code generator callable from compiled functions, and opaque to type checkers."""
    return intrinsic(function)


def _element(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    struct = context.make_array(array_type)(context, builder, array)
    return cgutils.gep_inbounds(builder, struct.data, index)


@_in_kernels
def load_acquire(_context: Any, array: Any, _index: Any) -> Any:
    """Return ``array[index]``; no later access moves before it (in compiled code, contiguous int64)."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = _element(context, builder, signature.args[0], *arguments)
        return builder.load_atomic(pointer, "acquire", ALIGNMENT)

    return types.int64(array, types.intp), codegen


@_in_kernels
def store_release(_context: Any, array: Any, _index: Any, _value: Any) -> Any:
    """Set ``array[index] = value``; no earlier access moves after it (in compiled code, contiguous int64)."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array_value, index, value = arguments
        pointer = _element(context, builder, signature.args[0], array_value, index)
        builder.store_atomic(value, pointer, "release", ALIGNMENT)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.int64), codegen


# These two keep Python's lock: beside a thread that never rests, giving it up for an instant costs 5 ms.
@kernel("int64(int64[::1], intp)")
def load(array: Any, index: int) -> int:
    """Return ``array[index]`` with acquire ordering, called from Python.

    >>> import numpy as np
    >>> load(np.array([3, 4]), 1)
    4
    """
    return load_acquire(array, index)


@kernel("void(int64[::1], intp, int64)")
def store(array: Any, index: int, value: int) -> None:
    """Set ``array[index] = value`` with release ordering, called from Python.

    >>> import numpy as np
    >>> numbers = np.array([3, 4])
    >>> store(numbers, 1, 5)
    >>> numbers
    array([3, 5])
    """
    store_release(array, index, value)
