"""The contract of a figure: frozen options, drawn onto a matplotlib figure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from monochord.core.errors import MissingLibraryError
from monochord.core.ranges import Checked

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


class Figure(Checked, ABC):
    """Options of a figure, as a frozen keyword-only dataclass."""

    @abstractmethod
    def draw(self) -> Canvas:
        """Compute what the figure shows and return it drawn, good enough to print."""


class Measured(Figure):
    """A figure that also returns what it shows as numbers, for `monochord figure NAME --json`."""

    @abstractmethod
    def numbers(self) -> dict[str, Any]:
        """Return what the figure shows, by name, as values that JSON can hold."""


def require_matplotlib() -> None:
    """Check that matplotlib is installed.

    Raises
    ------
    MissingLibraryError
        If it is not; the error says how to install it.
    """
    if find_spec("matplotlib") is None:
        raise MissingLibraryError("Drawing a figure", "matplotlib >= 3.9", "figures")
