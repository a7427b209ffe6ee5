"""What an estimator told over what was true: position and force."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.config import to_tree
from monochord.core.errors import InputError
from monochord.evaluation.results import CLEAN, Results
from monochord.evaluation.scores import regression, regression_rows
from monochord.figures import _style
from monochord.figures._results import COLOURS, LETTER_OF, SHOWN, in_condition, whose
from monochord.figures.base import Measured
from monochord.metrics import LIMITS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter(Measured):
    """Estimates of position and force over the truth, a point a touched window, a colour an object.

    Dashed lines are as far off as the paper allows: 5 mm and 0.2 N. The errors in each panel are of all
    windows that were answered, and the share that is near enough is of all that were to be. What was told
    beyond the truth's own range is drawn at its edge.

    Parameters
    ----------
    results
        The file ``results.npz`` that `monochord evaluate` wrote.
    condition
        In which was listened: "clean", or another that the results tell.
    points
        Drawn at most of each object, spread evenly over its windows.
    """

    results: Path
    condition: str = CLEAN
    points: int = 2000

    def __post_init__(self) -> None:
        if self.points < 1:
            raise InputError(f"points {self.points}", "1 or more")

    def numbers(self) -> dict[str, Any]:
        """Return errors of both quantities, all in all and by object."""
        results = in_condition(self.results, self.condition)
        told = {"simulated": results.simulated, "estimator": results.estimator, "condition": self.condition}
        return told | {
            name: {
                body: to_tree(regression(results, name, rows, draws=0))
                for body, rows in {"all": np.ones(len(results), bool), **_bodies(results)}.items()
            }
            for name in SHOWN
        }

    def draw(self) -> Canvas:
        """Read the results and draw both panels."""
        results = in_condition(self.results, self.condition)
        page = _style.canvas(92.0)
        panels = page.subplots(1, 2)
        for letter, axes, name in zip("AB", panels, SHOWN, strict=True):
            self._draw(axes, letter, results, name)
        page.suptitle(whose(results, self.condition), fontsize=_style.LABEL, color=_style.INK)
        _style.key(page, *panels)
        return page

    def _draw(self, axes: Axes, letter: str, results: Results, name: str) -> None:
        (factor, unit), symbol = SHOWN[name], LETTER_OF[name]
        told = regression(results, name, draws=0)
        lines = [f"{told.windows} windows, nothing told"]
        if told.mae.value is not None:
            lines = [f"MAE {factor * told.mae.value:.3g} {unit}"]
            lines += [] if told.r.value is None else [f"r = {told.r.value:.3f}"]
            near = 100.0 * (told.within.value or 0.0)
            lines += [f"{near:.1f} % of {told.windows} within {factor * LIMITS[name]:g} {unit}"]
        _style.dress(axes, letter, name, f"true {symbol} ({unit})", f"told {symbol} ({unit})")
        axes.text(
            0.03, 0.97, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=_style.TICK,
            color=_style.INK,
        )  # fmt: skip
        truth = factor * results.label(name)[regression_rows(results, name)]
        if not truth.size:
            return
        span = np.array([truth.min(), truth.max()])
        span += 0.04 * np.ptp(span) * np.array([-1.0, 1.0]) + np.array([-1e-9, 1e-9])
        for shift in (-LIMITS[name], LIMITS[name]):
            axes.plot(span, span + factor * shift, color=_style.PALE, lw=0.7, ls=_style.THEORY)
        axes.plot(span, span, color=_style.INK, lw=0.7)
        for number, (body, rows) in enumerate(_bodies(results).items()):
            answered = np.flatnonzero(
                rows & regression_rows(results, name) & np.isfinite(results.estimate(name))
            )
            some = answered[:: max(-(-len(answered) // self.points), 1)]
            colour = COLOURS[number % len(COLOURS)]
            axes.plot([], [], ls="", marker="o", ms=3.5, color=colour, label=body)
            axes.scatter(
                factor * results.label(name)[some], np.clip(factor * results.estimate(name)[some], *span),
                s=3.0, color=colour, alpha=0.5, lw=0.0, rasterized=True,
            )  # fmt: skip
        axes.set(xlim=span, ylim=span)


def _bodies(results: Results) -> dict[str, np.ndarray]:
    """Return the rows (n,) of each object, by its name, in the order of the trials."""
    names = dict.fromkeys(trial.object for trial in results.trials)
    told = results.of_trials("object")
    rows = {name.replace("_", " ") or "an object": told == name for name in names}
    return {name: at for name, at in rows.items() if at.any()}
