"""The figure of a design: what other strings would do, and what the recommended one does along its range."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monochord.figures import COLOURS, style
from monochord.front.design import StringDesign
from monochord.physics.design import COMPARED, MAX_MODE, ambiguity, string_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas


def draw(design: StringDesign) -> Canvas:
    """Return six panels: trade-off, tension, force, position, ambiguity and drift."""
    page = style.canvas(125.0)
    panels = page.subplots(2, 3)
    _trade_off(panels[0, 0], design)
    _tensions(panels[0, 1], design)
    _forces(panels[0, 2], design)
    _positions(panels[1, 0], design)
    _doubles(panels[1, 1], design)
    _frames(panels[1, 2], design)
    for axes in panels.ravel():
        axes.tick_params(which="minor", labelsize=style.TICK - 1.0, width=0.4, length=1.5)
        if axes.get_legend_handles_labels()[1]:
            place = "lower left" if axes is panels[0, 0] else "best"
            axes.legend(
                loc=place, fontsize=style.TICK - 1.0, frameon=False, labelcolor=style.INK, handlelength=1.4
            )
    return page


def _trade_off(axes: Axes, design: StringDesign) -> None:
    style.dress(axes, "A", "speed and force", "a touch settles in (ms)", "force, standard error (N)")
    for meets, colour, label in ((False, style.PALE, "lacks a wish"), (True, COLOURS[2], "meets every wish")):
        some = [each for each in design.candidates if meets == (not each.lacks)]
        axes.plot(
            [1e3 * each.settling for each in some], [each.force_std for each in some], "o", ms=2.2, mew=0.0,
            color=colour, label=label,
        )  # fmt: skip
    front = design.pareto
    axes.plot(
        [1e3 * each.settling for each in front], [each.force_std for each in front], color=style.INK, lw=0.8,
        label="best of those that hold",
    )  # fmt: skip
    one = design.chosen
    axes.plot(1e3 * one.settling, one.force_std, "*", ms=9, color=COLOURS[1], label="recommended")
    axes.axhline(design.wishes.force_resolution, color=style.INK, lw=0.6, ls=style.THEORY)
    axes.set_yscale("log")


def _tensions(axes: Axes, design: StringDesign) -> None:
    style.dress(axes, "B", "tension and gauge", "tension (N)", "force, standard error (N)")
    length = design.chosen.string.length
    same = [each for each in design.candidates if each.string.length == length]
    gauges = sorted({each.string.core_diameter for each in same})
    for gauge, colour in zip(gauges, COLOURS, strict=False):
        some = [each for each in same if each.string.core_diameter == gauge]
        axes.plot(
            [each.string.tension for each in some], [each.force_std for each in some], ".-", ms=2.5, lw=0.8,
            color=colour, label=f"{1e3 * gauge:.3f} mm",
        )  # fmt: skip
    axes.axhline(design.wishes.force_resolution, color=style.INK, lw=0.6, ls=style.THEORY)
    axes.set_yscale("log")


def _forces(axes: Axes, design: StringDesign) -> None:
    style.dress(axes, "C", "force along the range", "position (mm)", "force, standard error (N)")
    curves = design.curves
    for force, std, colour in zip(curves.forces, curves.force_std, COLOURS, strict=False):
        axes.plot(1e3 * curves.positions, std, color=colour, lw=1.0, label=f"{force:g} N")
    axes.set_yscale("log")


def _positions(axes: Axes, design: StringDesign) -> None:
    style.dress(axes, "D", "lines along the range, 1 N", "position (mm)", "fundamental (kHz)")
    curves = design.curves
    for side, colour in enumerate(style.SEGMENTS):
        axes.plot(
            1e3 * curves.positions,
            1e-3 * curves.lines[:, side],
            color=colour,
            lw=1.2,
            label=f"$f_{side + 1}$",
        )
    worst = 1e3 * curves.position_std.max()
    axes.text(
        0.5, 0.93, f"position to {worst:.2g} mm", transform=axes.transAxes, ha="center", fontsize=style.TICK
    )


def _doubles(axes: Axes, design: StringDesign) -> None:
    style.dress(axes, "E", "ambiguous pairs of modes", "position (mm)", "share of pairs (%)")
    string = design.chosen.string
    for tension, colour in zip(sorted({*COMPARED, string.tension}), COLOURS, strict=False):
        other = string_of(design.wishes, string.core_diameter, tension, string.length)
        ambiguous = ambiguity(design.wishes, other)
        axes.plot(
            1e3 * ambiguous.positions,
            100.0 * ambiguous.pairs / MAX_MODE**2,
            lw=0.8,
            color=colour,
            label=f"{tension:g} N",
        )
    axes.set_ylim(0.0, 100.0)


def _frames(axes: Axes, design: StringDesign) -> None:
    style.dress(axes, "F", "a kelvin reads as", "", "force (N)")
    frames = design.frames
    forces = np.array([force for _, force in frames.values()])
    axes.bar(range(len(frames)), forces, color=COLOURS[0], width=0.6)
    axes.set_xticks(range(len(frames)), list(frames), rotation=35, ha="right")
    axes.axhline(0.0, color=style.INK, lw=0.6)
    for at, (force, (cents, _)) in enumerate(zip(forces, frames.values(), strict=True)):
        axes.annotate(
            f"{cents:+.2f} c", (at, max(force, 0.0)), ha="center", va="bottom", fontsize=style.TICK - 1.0,
            xytext=(0, 1), textcoords="offset points",
        )  # fmt: skip
