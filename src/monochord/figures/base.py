"""The contract of a figure: frozen options, drawn onto a matplotlib figure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


class Figure(ABC):
    """Options of a figure, as a frozen keyword-only dataclass."""

    @abstractmethod
    def draw(self) -> Canvas:
        """Compute what the figure shows and return it drawn, good enough to print."""


class Measured(Figure):
    """A figure that can also tell in numbers what it shows, as `monochord figure NAME --json` does."""

    @abstractmethod
    def numbers(self) -> dict[str, Any]:
        """Return what the figure shows, by name, as values that JSON can hold."""
