"""The contract of a sink: frozen options, opened into a writer of predictions."""

from abc import ABC, abstractmethod
from collections.abc import Generator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

from monochord.core.types import Prediction, Signal, StreamHealth, Truth, Window


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """What a sink is handed for each window: the prediction and what a viewer wants beside it.

    `truth` is empty for real hardware; `skipped` counts windows left out so far because the reader was late.
    """

    prediction: Prediction
    window: Window
    health: StreamHealth
    truth: Truth
    skipped: int


class Writer(ABC):
    """An open sink."""

    @abstractmethod
    def write(self, moment: Moment) -> None:
        """Take one prediction; must return quickly, it runs in the live loop."""


class Sink(ABC):
    """Options of a sink, as a frozen keyword-only dataclass."""

    @abstractmethod
    def open(self, signal: Signal) -> AbstractContextManager[Writer]:
        """Open the sink for a signal; leaving the context flushes and closes it."""


class Listener(Sink, Writer):
    """A sink that is its own writer: for what only keeps or counts what passes. It serves one run."""

    @contextmanager
    def open(self, signal: Signal) -> Generator[Writer]:  # noqa: ARG002
        """Return itself: there is nothing to open."""
        yield self
