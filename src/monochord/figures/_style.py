"""One look for all figures: two columns wide, readable in print, safe for colour-blind eyes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from monochord.figures.base import require_matplotlib

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure as Canvas

TWO_COLUMNS = 182.0  # mm, the text width of a two-column journal page
SEGMENTS = ("#0072B2", "#D55E00")  # Okabe and Ito's blue and vermilion: segment 1 and segment 2
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#444444", "#999933")
"""Okabe and Ito's colours, distinct for colour-blind readers, and two more."""
INK, PALE = "#222222", "#9A9A9A"
THEORY = (0.0, (4.0, 3.0))  # dash of a theoretical value
LABEL, TICK, LETTER = 8.0, 7.0, 10.0  # points
LOUDNESS = "Greys"  # dark is loud; coloured theory stays visible over it, also in print


def canvas(height: float) -> Canvas:
    """Return an empty figure, two columns wide and `height` mm high, with automatic panel spacing."""
    require_matplotlib()
    from matplotlib.figure import Figure as Canvas  # noqa: PLC0415

    return Canvas(figsize=(TWO_COLUMNS / 25.4, height / 25.4), dpi=200, layout="constrained")


def dress(axes: Axes, letter: str, title: str, across: str, up: str) -> None:
    """Give a panel its letter, title, axis labels and the common look."""
    axes.set_title(letter, loc="left", fontsize=LETTER, fontweight="bold", color=INK, pad=4)
    axes.set_title(title, fontsize=LABEL, color=INK, pad=4)
    axes.set_xlabel(across, fontsize=LABEL, color=INK, labelpad=2)
    axes.set_ylabel(up, fontsize=LABEL, color=INK, labelpad=2)
    axes.tick_params(labelsize=TICK, color=INK, labelcolor=INK, width=0.6, length=2.5)
    for side, spine in axes.spines.items():
        spine.set_linewidth(0.6)
        spine.set_color(INK)
        spine.set_visible(side in {"left", "bottom"})


def key(page: Canvas, *panels: Axes, columns: int = 0) -> None:
    """Add a legend under the figure, each label once: in one line, or in columns."""
    shown = [pair for panel in panels for pair in zip(*panel.get_legend_handles_labels(), strict=True)]
    once = {label: handle for handle, label in shown}
    page.legend(
        once.values(), once.keys(), loc="outside lower center", ncols=columns or len(once),
        fontsize=TICK, frameon=False, handlelength=2.2, columnspacing=1.6, labelcolor=INK,
    )  # fmt: skip


def dress_bar(bar: Colorbar, label: str) -> None:
    """Give a colour bar its label and the common look."""
    bar.set_label(label, fontsize=LABEL, color=INK)
    bar.ax.tick_params(labelsize=TICK, color=INK, labelcolor=INK, width=0.6, length=2.5)
    bar.outline.set_linewidth(0.6)  # pyright: ignore[reportCallIssue]
