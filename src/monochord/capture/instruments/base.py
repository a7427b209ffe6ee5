"""The contract of an instrument: frozen options, opened into readings that are polled."""

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager

from monochord.core.types import Feed, InstrumentHealth, Readings


class Connection(ABC):
    """An open instrument, read by polling: whoever polls often enough loses nothing, and needs no thread.

    An instrument that falls silent or goes away is no error: `poll` gives nothing, tries to come back, and
    `health` counts. Nothing is made up for what was lost.
    """

    @property
    @abstractmethod
    def feed(self) -> Feed:
        """What the readings are."""

    @abstractmethod
    def poll(self) -> list[Readings]:
        """Return what has come since the last poll, oldest first, without waiting."""

    @property
    @abstractmethod
    def health(self) -> InstrumentHealth:
        """Counters so far."""


class Instrument(ABC):
    """Options of an instrument, as a frozen keyword-only dataclass whose first field is what to open.

    `open` raises `InputError` for options that cannot be used, and `DeviceError` for a device that is not
    there.
    """

    @abstractmethod
    def open(self) -> AbstractContextManager[Connection]:
        """Connect; leaving the context lets the device go."""
