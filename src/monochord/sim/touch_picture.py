"""A picture of a fingertip on a string, drawn with NumPy alone."""

import numpy as np
from numpy.typing import NDArray

from monochord.core.units import Metres, Newtons

__all__ = ["touch_picture"]

WIDTH, HEIGHT, MARGIN = 480, 160, 24
STRING_Y, SCALE = 110, 8e3
"""Row of the string at rest, and pixels per m of height: heights are magnified."""
PAPER, INK, FINGER, GOAL, TOLD = (250, 250, 247), (40, 40, 40), (200, 80, 40), (60, 140, 80), (40, 90, 180)


def touch_picture(
    *,
    length: Metres,
    place: Metres,
    height: Metres,
    force: Newtons,
    goal: tuple[Metres, Newtons],
    told: tuple[Metres, Metres] | None = None,
) -> NDArray[np.uint8]:
    """Return a picture (160, 480, 3): string, fingertip, goal in green, estimate in blue, forces as bars.

    Parameters
    ----------
    length
        Of the string.
    place, height
        Of the fingertip, along the string and above it.
    force
        With which it presses.
    goal
        Place and force.
    told
        The estimate of the place and its standard error; None for none.

    Examples
    --------
    >>> picture = touch_picture(length=0.2, place=0.08, height=1e-3, force=0.0, goal=(0.1, 1.0))
    >>> picture.shape, picture.dtype
    ((160, 480, 3), dtype('uint8'))
    """
    picture = np.full((HEIGHT, WIDTH, 3), PAPER, np.uint8)
    columns = np.arange(MARGIN, WIDTH - MARGIN)
    span = WIDTH - 2 * MARGIN

    def column(x: Metres) -> int:
        return round(MARGIN + span * float(np.clip(x / length, 0.0, 1.0)))

    def bar(x: int, value: Newtons, colour: tuple[int, int, int]) -> None:
        picture[HEIGHT - 8 - round(24 * min(value, 5.0)) : HEIGHT - 8, x : x + 6] = colour

    sag = round(min(4.0 * force, 20.0))
    tip = column(place)
    shape = np.interp(columns, [MARGIN, tip, WIDTH - MARGIN], [0.0, sag, 0.0]).round().astype(int)
    for line in (0, 1):
        picture[STRING_Y + shape + line, columns] = INK
    for x in (MARGIN, WIDTH - MARGIN):
        picture[STRING_Y - 8 : STRING_Y + 10, x - 2 : x + 2] = INK
    rows, across = np.mgrid[:HEIGHT, :WIDTH]
    bottom = STRING_Y + sag - round(min(max(height, 0.0) * SCALE, STRING_Y - 20))
    picture[(rows - bottom + 10) ** 2 + (across - tip) ** 2 <= 100] = FINGER
    aim = column(goal[0])
    picture[
        (np.abs(across - aim) <= (rows - STRING_Y - 6) / 2) & (rows > STRING_Y + 6) & (rows < STRING_Y + 20)
    ] = GOAL
    if told is not None:
        low, high = column(told[0] - told[1]), column(told[0] + told[1])
        picture[STRING_Y + 24 : STRING_Y + 28, low : high + 2] = TOLD
    bar(4, force, FINGER)
    bar(12, goal[1], GOAL)
    return picture
