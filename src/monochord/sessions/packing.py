"""Messages of ROS 2 from plain values, for those that are sent a hundred times a second."""

from collections.abc import Iterator
from functools import cache
from struct import Struct, calcsize
from typing import Any

from monochord.sessions.codec import typestore

LITTLE_ENDIAN = 1
"""Second byte of a message's encapsulation header."""
CODES = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""Characters of `struct` by the type of a field."""


def pack(name: str, *values: object) -> bytes:
    """Return a message of type `name` as CDR bytes, from the values of all its fields in depth.

    The bytes are those of `monochord.sessions.codec.encode`, without an object for each part. The type has no
    sequences and arrays. Raises `struct.error` for another number of values, or one that is not of its kind.

    >>> pack("std_msgs/msg/Header", 1, 500, "string").hex(" ", -4)
    '00010000 01000000 f4010000 07000000 73747269 6e6700'
    """
    flat: list[object] = [LITTLE_ENDIAN]
    sizes: list[int] = []
    for value in values:
        if isinstance(value, str):
            text = value.encode()
            sizes.append(len(text) + 1)  # with the zero at its end
            flat += len(text) + 1, text
        else:
            flat.append(value)
    return _layout(name, tuple(sizes)).pack(*flat)


@cache
def _layout(name: str, sizes: tuple[int, ...]) -> Struct:
    """Return the layout of a message whose texts have these sizes; each field is aligned to its own size."""
    code, end, texts = "<xBxx", 0, iter(sizes)
    for kind in _kinds(name):
        field = f"I{next(texts, 0)}s" if kind == "string" else CODES[kind]
        padding = -end % calcsize("<" + field[0])
        code += f"{padding}x{field}"
        end += padding + calcsize("<" + field)
    return Struct(code)


def _kinds(name: str) -> Iterator[str]:
    """Yield the basic types of a message's fields in depth."""
    fields: Any = typestore().fielddefs[name][1]
    for _, (kind, of) in fields:
        if kind.name == "NAME":
            yield from _kinds(of)
        else:
            yield of[0]
