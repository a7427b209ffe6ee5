"""Reading FlatBuffers, as far as a file of weights needs it.

A table begins with the distance back to its list of fields, which tells for each field how far into the table
its value is, 0 where it is absent. A string, vector or table stands elsewhere, at a distance from the field.
"""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Table:
    """One table in the bytes of a file."""

    data: bytes
    at: int

    @classmethod
    def root(cls, data: bytes) -> "Table":
        """Return the table that the file is of."""
        return cls(data, _whole(data, 0))

    def integer(self, field: int, kind: str = "i") -> int:
        """Return the integer in a field, its `struct` letter given; 0 where it is absent."""
        place = self._place(field)
        return struct.unpack_from(f"<{kind}", self.data, place)[0] if place else 0

    def table(self, field: int) -> "Table":
        """Return the table that a field refers to."""
        return Table(self.data, self._referred(field))

    def tables(self, field: int) -> list["Table"]:
        """Return the tables of a vector of them."""
        first = self._referred(field)
        places = range(first + 4, first + 4 + 4 * _whole(self.data, first), 4)
        return [Table(self.data, place + _whole(self.data, place)) for place in places]

    def numbers(self, field: int, kind: str) -> NDArray[np.generic]:
        """Return a vector of numbers (n,) of a NumPy type, read-only; none where the field is absent."""
        if not self._place(field):
            return np.zeros(0, kind)
        first = self._referred(field)
        return np.frombuffer(self.data, kind, _whole(self.data, first), first + 4)

    def _referred(self, field: int) -> int:
        place = self._place(field)
        return place + _whole(self.data, place)

    def _place(self, field: int) -> int:
        listing = self.at - struct.unpack_from("<i", self.data, self.at)[0]
        (size,) = struct.unpack_from("<H", self.data, listing)
        entry = 4 + 2 * field
        if entry >= size:
            return 0
        (offset,) = struct.unpack_from("<H", self.data, listing + entry)
        return self.at + offset if offset else 0


def _whole(data: bytes, place: int) -> int:
    return struct.unpack_from("<I", data, place)[0]
