"""The figure of a located recording: places over time with their standard errors, and the frets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monochord.core.pitch_names import pitch_name
from monochord.core.ranges import checked
from monochord.figures import style
from monochord.front.located import Located

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas
ERRORS, FAINT = "#7FB3D9", "#D5D5D5"
"""Colours of standard errors and of frets without a dot."""
NAME_HEIGHT = 0.03
"""Height of a fret's name, as a share of the axis; where frets are closer, those with a dot are named."""
FRETS = 24
MARKED = (3, 5, 7, 9, 12, 15, 17, 19, 21, 24)
"""Frets that carry a dot on a fingerboard; their lines are darker."""
ROOM = 0.05
"""Room above and below the places, as a share of their range, and at least this share of the length."""


@checked
def draw(places: Located, *, frets: bool = False) -> Canvas:
    """Return one panel; with `frets`, lines where the frets are, named on the right by number and note."""
    page = style.canvas(80.0)
    axes = page.subplots()
    style.dress(axes, "", _title(places), "time (s)", f"position from {places.origin} (mm)")
    time, position, std = places.time + 0.5 * places.window, 1e3 * places.position, 1e3 * places.std
    axes.errorbar(
        time, position, yerr=std, fmt="o", ms=1.2, mew=0.0, color=style.SEGMENTS[0], ecolor=ERRORS,
        elinewidth=1.0, zorder=3,
    )  # fmt: skip
    axes.set_xlim(0.0, float(time[-1]) + 0.5 * places.window)
    axes.set_ylim(*_limits(position, std, 1e3 * places.length))
    if frets:
        _draw_frets(axes, places)
    if not np.isfinite(position).any():
        axes.text(
            0.5, 0.5, "no position", transform=axes.transAxes, ha="center", fontsize=style.LABEL,
            backgroundcolor="white",
        )  # fmt: skip
    return page


def _title(places: Located) -> str:
    kind = "simulated: " if places.simulated else ""
    valid = int(np.isfinite(places.position).sum())
    return f"{kind}places with their standard errors, {valid} of {len(places)} windows"


def _limits(position: np.ndarray, std: np.ndarray, length: float) -> tuple[float, float]:
    """Return the limits of the axis in mm: what there is to see, or the whole string."""
    known = np.isfinite(position)
    if not known.any():
        return 0.0, length if np.isfinite(length) else 1.0
    low, high = float((position - std)[known].min()), float((position + std)[known].max())
    room = ROOM * max(high - low, length if np.isfinite(length) else high)
    return max(low - room, -0.2 * room), high + room


def _draw_frets(axes: Axes, places: Located) -> None:
    """Draw the frets in sight: the n-th at x = L (1 - 2^(-n/12)) from the nut."""
    low, high = axes.get_ylim()
    numbers = np.arange(FRETS + 1)
    lines = 1e3 * places.length * (1.0 - 2.0 ** (-numbers / 12.0))
    for fret, line in zip(numbers.tolist(), lines.tolist(), strict=True):
        if not low <= line <= high:
            continue
        axes.axhline(line, color=style.PALE if fret in MARKED else FAINT, lw=0.6, zorder=1)
        room = (1e3 * places.length - line) * (1.0 - 2.0 ** (-1.0 / 12.0))  # to the next fret
        if room < NAME_HEIGHT * (high - low) and fret not in MARKED:
            continue
        note = pitch_name(places.open_frequency * 2.0 ** (fret / 12.0), cents=False)
        name = "open" if fret == 0 else f"{fret}"
        axes.annotate(
            f"{name}  {note}", (1.0, line), xycoords=axes.get_yaxis_transform(), xytext=(3, 0),
            textcoords="offset points", va="center", fontsize=style.TICK - 1.0, color=style.INK,
        )  # fmt: skip
