"""The contract of an instrument: frozen options, opened into readings that are polled."""

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager

from monochord.core.ranges import Checked
from monochord.core.types import Feed, InstrumentHealth, Readings


class Connection(ABC):
    """An open instrument, read by polling: frequent polls lose nothing, and it needs no thread.

    A silent or absent instrument is not an error: `poll` returns no readings and tries to reconnect, and
    `health` counts. Lost readings are never filled in.

    Examples
    --------
    >>> from monochord import Connection, Feed, Readings
    >>> from monochord.core.types import InstrumentHealth
    >>> class Nothing(Connection):
    ...     feed = Feed(stream="room", columns=("temperature",), units=("K",))
    ...     health = InstrumentHealth()
    ...
    ...     def poll(self) -> list[Readings]:
    ...         return []
    >>> Nothing().poll()
    []
    """

    @property
    @abstractmethod
    def feed(self) -> Feed:
        """Description of the readings."""

    @abstractmethod
    def poll(self) -> list[Readings]:
        """Return the readings since the last poll, oldest first, without waiting."""

    @property
    @abstractmethod
    def health(self) -> InstrumentHealth:
        """Counters so far."""


class Instrument(Checked, ABC):
    """Options of an instrument, as a frozen keyword-only dataclass whose first field is its address.

    `open` raises `InputError` for invalid options, and `DeviceError` for a missing device.

    Examples
    --------
    >>> from collections.abc import Iterator
    >>> from contextlib import contextmanager
    >>> from dataclasses import dataclass
    >>> from monochord import Connection, Feed, Instrument, Readings
    >>> from monochord.core.types import InstrumentHealth
    >>> class Silent(Connection):
    ...     feed = Feed(stream="room", columns=("temperature",), units=("K",))
    ...     health = InstrumentHealth()
    ...
    ...     def poll(self) -> list[Readings]:
    ...         return []
    >>> @dataclass(frozen=True, slots=True, kw_only=True)
    ... class Thermometer(Instrument):
    ...     port: str = "/dev/ttyUSB0"
    ...
    ...     @contextmanager
    ...     def open(self) -> Iterator[Connection]:
    ...         yield Silent()
    >>> with Thermometer(port="/dev/ttyUSB1").open() as connection:
    ...     connection.feed.stream
    'room'
    """

    @abstractmethod
    def open(self) -> AbstractContextManager[Connection]:
        """Connect; leaving the context releases the device."""
