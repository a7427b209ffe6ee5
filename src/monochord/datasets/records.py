"""Many equal dataclasses in little memory: packed as bytes, unpacked one by one as they are read."""

from array import array
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from operator import attrgetter
from typing import Any, Generic, TypeVar, overload

import msgspec

from monochord.datasets.checksums import FileSums

T = TypeVar("T")


class PackedRecords(Sequence[T], Generic[T]):
    """A sequence of a dataclass whose fields are numbers, texts, truth values, None and tuples of these.

    >>> from monochord.datasets.checksums import FileSums
    >>> records = PackedRecords(FileSums, [FileSums(bytes=3, blocks=("ab",)), FileSums(bytes=0, blocks=())])
    >>> len(records), records[-1].bytes, records == (records[0], records[1])
    (2, 0, True)
    """

    def __init__(self, kind: type[T], items: Iterable[T] = ()) -> None:
        self._kind, self._names = kind, tuple(field.name for field in fields(kind))  # pyright: ignore[reportArgumentType]
        self._values, self._encoder = attrgetter(*self._names), msgspec.msgpack.Encoder()
        self._data, self._ends = bytearray(), array("q", [0])
        for item in items:
            self.append(item)

    def append(self, item: T) -> None:
        """Add one at the end."""
        self._data += self._encoder.encode(self._values(item))
        self._ends.append(len(self._data))

    def __len__(self) -> int:
        return len(self._ends) - 1

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[T]: ...
    def __getitem__(self, index: int | slice) -> T | Sequence[T]:
        if isinstance(index, slice):
            return tuple(self[number] for number in range(*index.indices(len(self))))
        number = range(len(self))[index]
        values: list[Any] = msgspec.msgpack.decode(self._data[self._ends[number] : self._ends[number + 1]])
        return self._kind(
            **{
                name: tuple(value) if isinstance(value, list) else value
                for name, value in zip(self._names, values, strict=True)
            }
        )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence):
            return NotImplemented
        return len(self) == len(other) and all(one == two for one, two in zip(self, other, strict=True))

    __hash__ = None  # pyright: ignore[reportAssignmentType]


@dataclass(frozen=True, slots=True, kw_only=True)
class _FileRecord:
    """A file's name with its checksums."""

    name: str
    bytes: int
    blocks: tuple[str, ...]


class PackedFiles(Mapping[str, FileSums]):
    """The checksums of many files, sorted by name.

    >>> files = PackedFiles([("b", FileSums(bytes=0, blocks=())), ("a", FileSums(bytes=1, blocks=("ab",)))])
    >>> list(files), files["b"].bytes, "c" in files
    (['a', 'b'], 0, False)
    """

    def __init__(self, items: Iterable[tuple[str, FileSums]]) -> None:
        self._records = PackedRecords(
            _FileRecord,
            (_FileRecord(name=name, bytes=sums.bytes, blocks=sums.blocks) for name, sums in items),
        )
        names = [record.name for record in self._records]
        self._order = array("q", sorted(range(len(names)), key=names.__getitem__))
        self._last = _FileRecord(name="", bytes=0, blocks=())

    def __len__(self) -> int:
        return len(self._order)

    def __iter__(self) -> Iterator[str]:
        for number in self._order:
            self._last = self._records[number]  # what is read next
            yield self._last.name

    def __getitem__(self, name: str) -> FileSums:
        if name != self._last.name:
            at = bisect_left(self._order, name, key=lambda number: self._records[number].name)
            record = self._records[self._order[at]] if at < len(self) else None
            if record is None or record.name != name:
                raise KeyError(name)
            self._last = record
        if not name:
            raise KeyError(name)
        return FileSums(bytes=self._last.bytes, blocks=self._last.blocks)
