"""The contract of a sink: frozen options, opened into a writer of predictions."""

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from dataclasses import dataclass

from monochord.types import Prediction, Signal, StreamHealth, Truth, Window


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
