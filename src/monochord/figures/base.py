"""The contract of a figure: frozen options, drawn onto a matplotlib figure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


class Figure(ABC):
    """Options of a figure, as a frozen keyword-only dataclass."""

    @abstractmethod
    def draw(self) -> Canvas:
        """Compute what the figure shows and return it drawn, good enough to print."""
