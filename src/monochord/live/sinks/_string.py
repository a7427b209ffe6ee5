"""The drawn string: between nut and bridge, bent where it is touched, swinging as loud as it sounds."""

from collections.abc import Sequence

import numpy as np
from rich.text import Text

from monochord.core.types import Floats
from monochord.core.units import Metres, Newtons
from monochord.live.sinks._canvas import Canvas

ROWS = 5
REST = 6.0  # dots from the top to the string at rest
SWING = 5.0  # dots of the largest swing
TOUCH, TRUTH, STRING, BLUR, QUIET = "bold bright_cyan", "yellow", "bold white", "grey50", "grey42"


def draw(
    columns: int,
    length: Metres,
    touch: tuple[Metres, Metres] | None,
    truth: Metres | None,
    force: Newtons | None,
    levels: Sequence[float],
    caption: str = "",
) -> list[Text]:
    """Return the picture as lines of `columns` cells.

    `touch` is position and standard error, `levels` the loudness of the two segments from 0 to 1; without
    a touch only the largest counts. `caption` stands where the touch really is, at `truth`, or at the nut.
    """
    canvas = Canvas(columns - 2, ROWS)
    if touch is None:
        _segment(canvas, 0, canvas.width, np.full(canvas.width, REST), max(levels))
    else:
        _touched(canvas, float(np.clip(touch[0] / length, 0.0, 1.0)), force, levels)
    lines = [Text.assemble(("▐", QUIET), line, ("▌", QUIET)) for line in canvas.lines()]
    above = _spread(columns, length, touch)
    return [above, *lines, _true(columns, length, truth, caption), *_ruler(columns, length)]


def _touched(canvas: Canvas, place: float, force: Newtons | None, levels: Sequence[float]) -> None:
    at = round(np.clip(place * (canvas.width - 1), 1, canvas.width - 2))
    depth = 6.0 if force is None else float(np.clip(2.0 + 6.0 * force, 2.0, 12.0))
    _segment(canvas, 0, at, np.linspace(REST, REST + depth, at), levels[0])
    _segment(canvas, at, canvas.width, np.linspace(REST + depth, REST, canvas.width - at), levels[-1])
    tip = max(int(REST + depth) // 4 - 1, 0)
    for row in range(tip + 1):
        canvas.sign(at // 2, row, "▼" if row == tip else "┃", TOUCH)


def _segment(canvas: Canvas, left: int, right: int, rest: Floats, level: float) -> None:
    """Draw one segment between its outermost swings."""
    shape = SWING * level * np.sin(np.pi * np.arange(right - left) / max(right - left - 1, 1))
    for part in (-1.0, 1.0) if shape.max(initial=0.0) >= 1.0 else ():
        canvas.curve(rest + part * shape, BLUR, left)
    canvas.curve(rest, STRING, left)


def _spread(columns: int, length: Metres, touch: tuple[Metres, Metres] | None) -> Text:
    """Return the line above the string: two standard errors to each side of the touch."""
    if touch is None:
        return Text(" " * columns)
    column = _column(columns, length, touch[0])
    reach = round(2.0 * touch[1] / length * (columns - 3)) if np.isfinite(touch[1]) else 0
    left, right = max(column - reach, 0), min(column + reach, columns - 1)
    return Text(" " * left + "╌" * (column - left) + "┃" + "╌" * (right - column), TOUCH)


def _true(columns: int, length: Metres, truth: Metres | None, caption: str) -> Text:
    """Return the line below the string: where the touch really is, and what it does there."""
    if truth is None:
        return Text(f" {caption}"[:columns].ljust(columns), TRUTH)
    column = _column(columns, length, truth)
    words = caption or "truth"
    if column + 2 + len(words) <= columns:
        return Text(" " * column + f"▲ {words}", TRUTH)
    # A caption that has no room on either side gives way to the first of its words.
    words = words if len(words) < column else words.partition(",")[0]
    return Text(f"{words} ▲".rjust(column + 1), TRUTH)


def _ruler(columns: int, length: Metres) -> list[Text]:
    """Return the scale in millimetres from the nut, with some six round steps."""
    step = next((s for s in (5, 10, 20, 25, 50, 100, 200, 250, 500) if 1e3 * length / s <= 7.0), 1000)
    line = ["└", *"─" * (columns - 2), "┘"]
    numbers = list("nut" + " " * (columns - 9) + "bridge")
    for millimetres in range(step, int(1e3 * length), step):
        column = _column(columns, length, 1e-3 * millimetres)
        line[column] = "┴"
        text = f"{millimetres} mm" if millimetres == step else str(millimetres)
        left = column - len(str(millimetres)) // 2
        if left > len("nut ") and left + len(text) < columns - len("bridge "):
            numbers[left : left + len(text)] = text
    return [Text("".join(line), QUIET), Text("".join(numbers), QUIET)]


def _column(columns: int, length: Metres, position: Metres) -> int:
    return 1 + round(np.clip(position / length, 0.0, 1.0) * (columns - 3))
