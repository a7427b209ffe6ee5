"""The drawn string: fixed at its ends, bent at the touch, swinging according to loudness."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from rich.text import Text

from monochord.core.types import Floats
from monochord.core.units import Metres, Newtons

ROWS = 5
REST = 6.0  # dots from the top to the string at rest
SWING = 5.0  # dots of the largest swing
TOUCH, TRUTH, STRING, BLUR, FRAME = "bold bright_cyan", "yellow", "bold white", "grey50", "grey42"
DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
"""Bits of a Braille character by row and column."""


class Canvas:
    """Curves in Braille dots, two columns and four rows in each character cell.

    Later curves are drawn over earlier ones; a cell takes the style of its last curve.
    """

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self._dots = np.zeros((4 * rows, 2 * columns), bool)
        self._style = np.zeros((rows, columns), np.intp)
        self._styles = [""]
        self._signs: dict[tuple[int, int], int] = {}

    @property
    def width(self) -> int:
        """Width in dots."""
        return 2 * self.columns

    def curve(self, heights: Floats, style: str, first: int = 0) -> None:
        """Draw a curve from dot column `first` on, from its height below the top in dots for each column.

        Neighbouring points are joined, so that a steep curve has no gaps.
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
        """Put a character over a cell's dots."""
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


def draw(
    columns: int,
    length: Metres,
    touch: tuple[Metres, Metres] | None,
    truth: Metres | None,
    force: Newtons | None,
    levels: Sequence[float],
    caption: str = "",
    ends: tuple[str, str] = ("nut", "bridge"),
) -> list[Text]:
    """Return the picture as lines of `columns` cells.

    `touch` is position and standard error, `levels` the loudness of the two segments from 0 to 1; without a
    touch only the larger counts. `caption` stands at the true position `truth`, or at the left end. `ends`
    names the string's ends.
    """
    canvas = Canvas(columns - 2, ROWS)
    if touch is None:
        _segment(canvas, 0, canvas.width, np.full(canvas.width, REST), max(levels))
    else:
        _touched(canvas, float(np.clip(touch[0] / length, 0.0, 1.0)), force, levels)
    lines = [Text.assemble(("▐", FRAME), line, ("▌", FRAME)) for line in canvas.lines()]
    above = _spread(columns, length, touch)
    return [above, *lines, _true(columns, length, truth, caption), *_ruler(columns, length, ends)]


def _touched(canvas: Canvas, place: float, force: Newtons | None, levels: Sequence[float]) -> None:
    column = round(place * (canvas.columns - 1))  # that of the lines above and below
    at = min(2 * column + 1, canvas.width - 2)
    depth = 6.0 if force is None else float(np.clip(2.0 + 6.0 * force, 2.0, 12.0))
    _segment(canvas, 0, at, np.linspace(REST, REST + depth, at), levels[0])
    _segment(canvas, at, canvas.width, np.linspace(REST + depth, REST, canvas.width - at), levels[-1])
    tip = max(int(REST + depth) // 4 - 1, 0)
    for row in range(tip + 1):
        canvas.sign(column, row, "▼" if row == tip else "┃", TOUCH)


def _segment(canvas: Canvas, left: int, right: int, rest: Floats, level: float) -> None:
    """Draw one segment between its outermost swings."""
    shape = SWING * level * np.sin(np.pi * np.arange(right - left) / max(right - left - 1, 1))
    for part in (-1.0, 1.0) if shape.max(initial=0.0) >= 1.0 else ():
        canvas.curve(rest + part * shape, BLUR, left)
    canvas.curve(rest, STRING, left)


def _spread(columns: int, length: Metres, touch: tuple[Metres, Metres] | None) -> Text:
    """Return the line above the string: two standard errors on each side of the touch."""
    if touch is None:
        return Text(" " * columns)
    column = _column(columns, length, touch[0])
    reach = round(2.0 * touch[1] / length * (columns - 3)) if np.isfinite(touch[1]) else 0
    left, right = max(column - reach, 0), min(column + reach, columns - 1)
    return Text(" " * left + "╌" * (column - left) + "┃" + "╌" * (right - column), TOUCH)


def _true(columns: int, length: Metres, truth: Metres | None, caption: str) -> Text:
    """Return the line below the string: the true position, and the touch's true state."""
    if truth is None:
        return Text(f" {caption}"[:columns].ljust(columns), TRUTH)
    column = _column(columns, length, truth)
    words = caption or "truth"
    if column + 2 + len(words) <= columns:
        return Text(" " * column + f"▲ {words}", TRUTH)
    # A caption too long for either side gives way to the first of its words.
    words = words if len(words) < column else words.partition(",")[0]
    return Text(f"{words} ▲".rjust(column + 1), TRUTH)


def _ruler(columns: int, length: Metres, ends: tuple[str, str]) -> list[Text]:
    """Return the scale in millimetres from the left end, in about six round steps."""
    step = next((s for s in (5, 10, 20, 25, 50, 100, 200, 250, 500) if 1e3 * length / s <= 7.0), 1000)
    line = ["└", *"─" * (columns - 2), "┘"]
    left_end, right_end = ends
    numbers = list(left_end + right_end.rjust(columns - len(left_end)))
    for millimetres in range(step, int(1e3 * length), step):
        column = _column(columns, length, 1e-3 * millimetres)
        line[column] = "┴"
        text = f"{millimetres} mm" if millimetres == step else str(millimetres)
        left = column - len(str(millimetres)) // 2
        if left > len(left_end) + 1 and left + len(text) < columns - len(right_end) - 1:
            numbers[left : left + len(text)] = text
    return [Text("".join(line), FRAME), Text("".join(numbers), FRAME)]


def _column(columns: int, length: Metres, position: Metres) -> int:
    return 1 + round(np.clip(position / length, 0.0, 1.0) * (columns - 3))
