"""The contract of a sink: frozen options, opened for a run into a writer of predictions.

What the live loop must know of a sink beforehand, the sink declares: whether its output is data on standard
output, and whether each of several strings has one of its own. Nobody looks at its fields.
"""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Generator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from monochord.capture.sources.base import Controls
from monochord.core.ranges import Checked
from monochord.core.types import (
    Estimate,
    Estimates,
    NamedEstimates,
    Prediction,
    Signal,
    StreamHealth,
    Tracked,
    Truth,
    Window,
)
from monochord.core.units import Metres, Samples, Seconds
from monochord.live.events import Event
from monochord.live.health import Note
from monochord.perception.estimators.base import Condition

BACKLOG = 256
"""Windows that wait for most sinks: 2.5 s at the usual hop, and 9 MB of sound, which all sinks share."""
NEWEST = 10
"""Windows that wait for a sink whose reader acts on the newest: 0.1 s, as many as ROS 2 keeps of a topic."""
NOTHING_DECIDED: Mapping[str, bool] = MappingProxyType({})
NO_STRINGS: Mapping[str, Signal] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class Update(NamedEstimates):
    """What is known of a string at a window: `mc.listen` yields it, and a sink takes it.

    Each estimate is an attribute: ``update.position``, ``update.force``; ``update.tracked.position`` is the
    estimate over time, which also holds what was learned earlier of the same touch. `decided` says whether
    there is ``contact`` and ``slip``, without flicker; a name is missing where nothing is decided yet.
    `events` are those of this window, and `notes` what a person should know of the sensor now.

    `prediction` is the estimator's answer to `window` alone, and `condition` what the estimator knows of the
    string by then, None where it does not watch it. `truth` is empty for real hardware; `skipped` counts
    windows left out so far because the reader was late, and `health` what the source lost. `adc_time` is the
    monotonic-clock time of the window's first frame at the converter, where the source knows it, and
    `at_hand` that at which the last one was at hand. `string` is the name of the string, of a run that has
    several; empty for one alone. Sinks in several threads share an update.

    Examples
    --------
    >>> from monochord import VirtualSensor, listen
    >>> update = next(listen(VirtualSensor("prototype", seed=1)))
    >>> update.time, update.contact.valid, update.position.valid, update.truth["contact"]
    (0.0, True, False, 0.0)
    """

    prediction: Prediction
    window: Window
    health: StreamHealth
    truth: Truth
    skipped: int
    tracked: Tracked = field(default_factory=Tracked)
    decided: Mapping[str, bool] = field(default_factory=lambda: NOTHING_DECIDED)
    events: tuple[Event, ...] = ()
    notes: tuple[Note, ...] = ()
    condition: Condition | None = None
    adc_time: Seconds | None = None
    at_hand: Seconds | None = None
    string: str = ""

    @property
    def time(self) -> Seconds:
        """Start of the window, in seconds since the stream began."""
        return self.prediction.time

    @property
    def start(self) -> Samples:
        """Sample index of the window's first frame."""
        return self.prediction.start

    @property
    def latency(self) -> Seconds:
        """Time from the window's last sample being at hand to its estimates."""
        return self.prediction.latency

    @property
    def estimates(self) -> Estimates:
        """The estimates of this window by name; an open set."""
        return self.prediction.estimates

    def _named(self) -> Estimates:
        return self.prediction.estimates

    def __str__(self) -> str:
        """Return time and estimates as a person reads them."""
        return f"{self.time:.2f} s: " + "; ".join(f"{name} {each}" for name, each in self.estimates.items())

    def __getitem__(self, name: str) -> Estimate:
        """Return an estimate by name; deprecated, as ``update.position`` is the same."""
        said = f"update['{name}'] is deprecated: use update.{name}"
        warnings.warn(said, DeprecationWarning, stacklevel=2)
        return self.prediction[name]


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """The run that a sink is opened for.

    `signal` is what the source says of its audio, with the string; of several strings, that of the first or
    of the sink's own. `string` is the name of the string that the sink is for, empty for one alone or for all
    of `strings`, whose signals these are by name. `length` is that of the string, in m, where the estimator
    was given one, and `model` the folder or name of a trained model that answers, empty for none. `controls`
    are there where the string can be touched. `is_output_taken` says that standard output carries the data of
    another sink.

    Examples
    --------
    >>> run = Run(signal=Signal(sample_rate=44100, channels=2))
    >>> run.string, run.is_output_taken
    ('', False)
    """

    signal: Signal
    string: str = ""
    strings: Mapping[str, Signal] = field(default_factory=lambda: NO_STRINGS)
    length: Metres | None = None
    model: str = ""
    controls: Controls | None = None
    is_output_taken: bool = False


class NotDeliveredError(Exception):
    """Raised by a writer that could not deliver a window; the window is counted, and the sink goes on."""


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
        """Take one prediction; a slow writer loses the oldest that wait for it, and delays nobody else.

        Calls come one at a time, from a thread of the sink's own or from the live loop. A writer that raises
        is closed, and gets no more; `NotDeliveredError` only counts the window as left out.
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
        """Open the sink for a run; leaving the context, perhaps in another thread, closes it."""

    @contextmanager
    def ahead(self) -> Generator["Sink"]:
        """Begin what should not wait for the source, and yield the sink that is then opened."""
        yield self

    @property
    def backlog(self) -> int:
        """Windows that wait for it at most, where a clock paces the source; then the oldest is left out."""
        return BACKLOG

    @property
    def fills_standard_output(self) -> bool:
        """Whether its output is data on standard output, beside which nothing else may be printed there."""
        return False

    @property
    def is_for_each_string(self) -> bool:
        """Whether each of several strings has one of its own; otherwise one takes the updates of all."""
        return False


class Listener(Sink, Writer):
    """A sink that is its own writer, for one run: it stores or counts what passes.

    It is part of the program that runs the loop: called in the loop, and what it raises ends the run.
    """

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:  # noqa: ARG002
        """Return itself: there is nothing to open."""
        yield self


def __getattr__(name: str) -> Any:
    if name == "Moment":
        warnings.warn("Moment is deprecated: use Update", DeprecationWarning, stacklevel=2)
        return Update
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
