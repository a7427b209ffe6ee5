"""Estimates of position and force against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.config import to_tree
from monochord.core.ranges import Count
from monochord.core.types import Floats
from monochord.evaluation.results import CLEAN, Results
from monochord.evaluation.scores import regression, regression_rows
from monochord.figures import _style
from monochord.figures._results import SYMBOLS, UNITS, in_condition, title_of
from monochord.figures.base import Measured
from monochord.metrics import LIMITS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

MARGIN = 0.04
"""Margin of the axes beyond the range of truths, as a share of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter(Measured):
    """Estimates of position and force against the truth: a point per touched window, a colour per object.

    Dashed lines are the paper's limits: 5 mm and 0.2 N. The errors in each panel are over all windows with an
    estimate; the share within the limit is over all touched windows. Estimates beyond the axes are open
    triangles at the edge, with their number beside them.

    Parameters
    ----------
    results
        The file ``results.npz`` from `monochord evaluate`.
    condition
        Condition to draw: "clean", or another condition of the results.
    points
        Most points per object, spread evenly over its windows.
    """

    results: Path
    condition: str = CLEAN
    points: Count = 2000

    def numbers(self) -> dict[str, Any]:
        """Return the scores of both quantities, over all objects and by object."""
        results = in_condition(self.results, self.condition)
        about = {"simulated": results.simulated, "estimator": results.estimator, "condition": self.condition}
        return about | {
            name: {
                body: to_tree(regression(results, name, rows, draws=0))
                for body, rows in {"all": np.ones(len(results), bool), **_bodies(results)}.items()
            }
            for name in UNITS
        }

    def draw(self) -> Canvas:
        """Read the results and draw both panels."""
        results = in_condition(self.results, self.condition)
        page = _style.canvas(92.0)
        panels = page.subplots(1, 2)
        for letter, axes, name in zip("AB", panels, UNITS, strict=True):
            self._draw(axes, letter, results, name)
        page.suptitle(title_of(results, self.condition), fontsize=_style.LABEL, color=_style.INK)
        _style.key(page, *panels)
        return page

    def _draw(self, axes: Axes, letter: str, results: Results, name: str) -> None:
        (factor, unit), symbol = UNITS[name], SYMBOLS[name]
        score = regression(results, name, draws=0)
        lines = [f"{score.windows} windows, not estimated"]
        if score.mae.value is not None:
            lines = [f"MAE {factor * score.mae.value:.3g} {unit}"]
            lines += [] if score.r.value is None else [f"r = {score.r.value:.3f}"]
            within = 100.0 * (score.within.value or 0.0)
            lines += [f"{within:.1f} % of {score.windows} within {factor * LIMITS[name]:g} {unit}"]
        _style.dress(axes, letter, name, f"true {symbol} ({unit})", f"estimated {symbol} ({unit})")
        axes.text(
            0.03, 0.97, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=_style.TICK,
            color=_style.INK,
        )  # fmt: skip
        scored = regression_rows(results, name)
        truth = factor * results.label(name)
        if not scored.any():
            return
        span = np.array([truth[scored].min(), truth[scored].max()])
        span += MARGIN * np.ptp(span) * np.array([-1.0, 1.0]) + np.array([-1e-9, 1e-9])
        for shift in (-LIMITS[name], LIMITS[name]):
            axes.plot(span, span + factor * shift, color=_style.PALE, lw=0.7, ls=_style.THEORY)
        axes.plot(span, span, color=_style.INK, lw=0.7)
        estimate = factor * results.estimate(name)
        for number, (body, of_body) in enumerate(_bodies(results).items()):
            answered = np.flatnonzero(of_body & scored & np.isfinite(estimate))
            rows = answered[:: max(-(-len(answered) // self.points), 1)]
            colour = _style.COLOURS[number % len(_style.COLOURS)]
            axes.plot([], [], ls="", marker="o", ms=3.5, color=colour, label=body)
            _draw_points(axes, truth[rows], estimate[rows], span, colour)
        above = int((estimate[scored] > span[1]).sum())
        below = int((estimate[scored] < span[0]).sum())
        for count, height, align, word in ((above, 0.97, "top", "above"), (below, 0.03, "bottom", "below")):
            if count:
                axes.text(
                    0.97, height, f"{count} {word}", transform=axes.transAxes, ha="right", va=align,
                    fontsize=_style.TICK, color=_style.INK,
                )  # fmt: skip
        axes.set(xlim=span, ylim=span)


def _draw_points(axes: Axes, truth: Floats, estimate: Floats, span: Floats, colour: str) -> None:
    """Draw points inside the axes as dots, points outside as triangles at the edge."""
    inside = (estimate >= span[0]) & (estimate <= span[1])
    axes.scatter(truth[inside], estimate[inside], s=3.0, color=colour, alpha=0.5, lw=0.0, rasterized=True)
    for outside, edge, marker in ((estimate > span[1], span[1], "^"), (estimate < span[0], span[0], "v")):
        if outside.any():
            axes.plot(
                truth[outside], np.full(int(outside.sum()), edge), ls="", marker=marker, ms=4.0, mfc="none",
                mec=colour, mew=0.7, clip_on=False,
            )  # fmt: skip


def _bodies(results: Results) -> dict[str, np.ndarray]:
    """Return the rows (n,) of each object by name, in order of the trials."""
    column = results.of_trials("object")
    names = dict.fromkeys(trial.object for trial in results.trials)
    rows = {name.replace("_", " ") or "an object": column == name for name in names}
    return {name: at for name, at in rows.items() if at.any()}
