"""A canvas of Braille dots, two across and four down in every character cell."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from rich.text import Text

from monochord.core.types import Floats

DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])


class Canvas:
    """Curves drawn over each other in styles; a cell takes the style of the curve drawn last in it."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self._dots = np.zeros((4 * rows, 2 * columns), bool)
        self._style = np.zeros((rows, columns), np.intp)
        self._styles = [""]
        self._signs: dict[tuple[int, int], int] = {}

    @property
    def width(self) -> int:
        """Dots across."""
        return 2 * self.columns

    def curve(self, heights: Floats, style: str, first: int = 0) -> None:
        """Draw a curve from dot column `first` on, given its height from the top in dots, one a column.

        Neighbouring points are joined, so that a steep curve has no holes.
        """
        self._styles.append(style)
        y = np.clip(np.rint(heights), 0, 4 * self.rows - 1).astype(np.intp)
        middle = (y + np.append(y[1:], y[-1:])) // 2
        low, high = np.minimum(y, middle), np.maximum(y, middle)
        row = np.arange(4 * self.rows)[:, None]
        drawn = np.zeros_like(self._dots)
        drawn[:, first : first + y.size] = (low <= row) & (row <= high)
        self._dots |= drawn
        self._style[_cells(drawn).any(axis=(2, 3))] = len(self._styles) - 1

    def sign(self, column: int, row: int, character: str, style: str) -> None:
        """Put a character over whatever dots its cell has."""
        self._styles.append(style)
        self._style[row, column] = len(self._styles) - 1
        self._signs[row, column] = ord(character)

    def lines(self) -> list[Text]:
        """Return the canvas as styled lines of text."""
        codes: NDArray[np.intp] = 0x2800 + (_cells(self._dots) * DOTS).sum(axis=(2, 3))
        for cell, code in self._signs.items():
            codes[cell] = code
        return [self._line(codes[row], self._style[row]) for row in range(self.rows)]

    def _line(self, codes: NDArray[np.intp], style: NDArray[np.intp]) -> Text:
        line = Text(no_wrap=True)
        edges = [0, *(np.flatnonzero(np.diff(style)) + 1), self.columns]
        for left, right in pairwise(edges):
            line.append("".join(map(chr, codes[left:right])), self._styles[style[left]])
        return line


def _cells(dots: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return dots (rows x 4, columns x 2) as cells (rows, columns, 4, 2)."""
    rows, columns = dots.shape[0] // 4, dots.shape[1] // 2
    return dots.reshape(rows, 4, columns, 2).transpose(0, 2, 1, 3)
