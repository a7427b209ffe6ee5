"""The contract of a sink: frozen options, opened for a run into a writer of predictions.

A sink declares everything that the live loop needs to know in advance: whether its output is data on standard
output, and whether each of several strings has its own instance. The loop does not look at its fields.
"""

from abc import ABC, abstractmethod
from collections.abc import Generator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from monochord.capture.sources.base import Controls
from monochord.core.ranges import Checked
from monochord.core.types import Signal
from monochord.core.units import Metres
from monochord.live.update import Update
from monochord.live.web.tasks import MakeTasks

if TYPE_CHECKING:
    from monochord.page.server import Page

__all__ = [
    "BACKLOG",
    "NEWEST",
    "Listener",
    "NotDeliveredError",
    "PageSink",
    "Run",
    "Sink",
    "Update",
    "Writer",
]

BACKLOG = 256
"""Default backlog in windows: 2.5 s at the usual hop, with 9 MB of sound shared by all sinks."""
NEWEST = 10
"""Backlog in windows of a sink whose reader needs the newest one: 0.1 s, ROS 2's usual topic depth.
"""
NO_STRINGS: Mapping[str, Signal] = MappingProxyType({})
NO_SENSORS: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class Run(Checked):
    """The run that a sink is opened for.

    `signal` is the source's audio format with the string; with several strings, that of the first or of this
    sink's string. `string` is the name of the sink's string; empty for a single string, or for a sink of all
    `strings`, which holds their signals by name. `sensors` holds the named sensor of each string, of a single
    one under the empty name. `length` is the string's length in m, where the estimator
    was given one, and `model` the trained model's folder or name, empty for none. `controls` is set where the
    string can be touched. `is_output_taken` is true where another sink writes data to standard output.

    Examples
    --------
    >>> run = Run(signal=Signal(sample_rate=44100, channels=2))
    >>> run.string, run.is_output_taken
    ('', False)
    """

    signal: Signal
    string: str = ""
    strings: Mapping[str, Signal] = field(default_factory=lambda: NO_STRINGS)
    sensors: Mapping[str, str] = field(default_factory=lambda: NO_SENSORS)
    length: Metres | None = None
    model: str = ""
    controls: Controls | None = None
    is_output_taken: bool = False


class NotDeliveredError(Exception):
    """Raised by a writer that could not deliver a window; the loss is counted, and the sink continues."""


class Writer(ABC):
    """An open sink.

    Examples
    --------
    >>> class Count(Writer):
    ...     windows = 0
    ...
    ...     def write(self, update: Update) -> None:
    ...         self.windows += 1
    >>> Count().windows
    0
    """

    @abstractmethod
    def write(self, update: Update) -> None:
        """Write one prediction; a slow writer loses the oldest ones waiting for it, and delays no other.

        Calls come one at a time, from the sink's thread or the live loop. A writer that raises is closed;
        `NotDeliveredError` only counts the window as left out.
        """


class Sink(Checked, ABC):
    """Options of a sink, as a frozen keyword-only dataclass.

    Examples
    --------
    >>> from collections.abc import Iterator
    >>> from contextlib import contextmanager
    >>> from dataclasses import dataclass
    >>> from monochord import Run, Sink, Update, Writer
    >>> class Lines(Writer):
    ...     def write(self, update: Update) -> None:
    ...         print(f"{update.time:.2f} s: {update.position}")
    >>> @dataclass(frozen=True, slots=True, kw_only=True)
    ... class Print(Sink):
    ...     @contextmanager
    ...     def open(self, run: Run) -> Iterator[Writer]:
    ...         yield Lines()
    >>> isinstance(Print(), Sink)
    True
    """

    @abstractmethod
    def open(self, run: Run) -> AbstractContextManager[Writer]:
        """Open the sink for a run; leaving the context, possibly in another thread, closes it."""

    @contextmanager
    def ahead(self) -> Generator["Sink"]:
        """Start anything that should not wait for the source, and yield the sink to open."""
        yield self

    @property
    def backlog(self) -> int:
        """Most windows that wait for the sink while a clock paces the source.

        Beyond, the oldest is dropped.
        """
        return BACKLOG

    @property
    def fills_standard_output(self) -> bool:
        """Whether the sink writes data to standard output, where nothing else may then be printed."""
        return False

    def ends_with_standard_output(self, run: Run) -> bool:  # noqa: ARG002  (for those that ask it)
        """Return whether a run ends where the reader of its standard output goes away, as `head` does."""
        return self.fills_standard_output

    @property
    def is_for_each_string(self) -> bool:
        """Whether each of several strings has its own instance; otherwise one instance takes all updates."""
        return False


class PageSink(Sink, ABC):
    """A sink that serves a page, which can do more than show the run where that is handed to it."""

    @abstractmethod
    def with_tasks(self, tasks: MakeTasks, *, pages: "Sequence[Page]" = ()) -> Sink:
        """Return this sink with what its page can ask for, and with further pages of its server."""


class Listener(Sink, Writer):
    """A sink that is its own writer, for one run: it stores or counts the updates.

    It belongs to the program that runs the loop: it is called in the loop, and its exceptions end the run.
    """

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:  # noqa: ARG002
        """Return itself; nothing needs opening."""
        yield self
