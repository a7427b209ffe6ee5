"""The contract of a figure: frozen options, and a drawing on a matplotlib figure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from monochord.core.errors import MissingLibraryError
from monochord.core.ranges import Checked

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


class Figure(Checked, ABC):
    """Options of a figure, as a frozen keyword-only dataclass.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> import monochord as mc
    >>> @dataclass(frozen=True, slots=True, kw_only=True)
    ... class Empty(mc.Figure):
    ...     def draw(self):
    ...         from matplotlib.figure import Figure as Canvas
    ...         return Canvas()
    >>> len(Empty().draw().axes)
    0
    """

    @abstractmethod
    def draw(self) -> Canvas:
        """Compute and draw the figure, in print quality."""


class Measured(Figure):
    """A figure that also returns its numbers, for `monochord figure NAME --json`."""

    @abstractmethod
    def numbers(self) -> dict[str, Any]:
        """Return the figure's numbers by name, as values for JSON."""


def require_matplotlib() -> None:
    """Raise `MissingLibraryError` unless matplotlib is installed."""
    if find_spec("matplotlib") is None:
        raise MissingLibraryError("Drawing a figure", "matplotlib >= 3.9", "figures")
