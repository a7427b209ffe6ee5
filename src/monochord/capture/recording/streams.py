"""Unique stream names, so that two instruments of a kind can be recorded together."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

from monochord.capture.instruments.base import Connection, Instrument
from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Feed, InstrumentHealth, Readings

COLUMNS = {"wrench": WRENCH, "pose": POSE}
"""Required columns of these streams, used by alignment and measured labels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedInstrument(Instrument):
    """An `instrument` whose stream is called `stream` instead of its default name."""

    instrument: Instrument
    stream: str

    @contextmanager
    def open(self) -> Generator[Connection]:
        """Open the instrument; raises `InputError` where a stream of this name must have other columns."""
        with self.instrument.open() as connection:
            columns = COLUMNS.get(self.stream, connection.feed.columns)
            if connection.feed.columns != columns:
                given = f"stream '{self.stream}' of {', '.join(connection.feed.columns)}"
                raise InputError(given, ", ".join(columns), "choose another stream name")
            yield _NamedConnection(connection, self.stream)


class _NamedConnection(Connection):
    def __init__(self, connection: Connection, stream: str) -> None:
        self._connection, self._stream = connection, stream

    @property
    def feed(self) -> Feed:
        return replace(self._connection.feed, stream=self._stream)

    @property
    def health(self) -> InstrumentHealth:
        return self._connection.health

    def poll(self) -> list[Readings]:
        return [replace(readings, stream=self._stream) for readings in self._connection.poll()]


def with_unique_streams(connections: Mapping[str, Connection]) -> dict[str, Connection]:
    """Return the connections, each with a unique stream name.

    Among instruments without a custom stream name, the first keeps the default, and the others get a number:
    ``pose``, ``pose_2``, ``pose_3``.
    """
    taken = {each.feed.stream for each in connections.values() if isinstance(each, _NamedConnection)}
    unique: dict[str, Connection] = {}
    for name, connection in connections.items():
        unique[name] = connection
        if not isinstance(connection, _NamedConnection):
            stream = free_name(connection.feed.stream, taken)
            taken.add(stream)
            if stream != connection.feed.stream:
                unique[name] = _NamedConnection(connection, stream)
    return unique


def free_name(name: str, taken: "Mapping[str, object] | set[str]") -> str:
    """Return the name if it is free, else the name with the smallest free number from 2 on.

    >>> free_name("pose", {"pose", "pose_2"})
    'pose_3'
    """
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name}_{number}"
    return free
