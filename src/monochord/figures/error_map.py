"""Errors of an estimator as maps over true position and force."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.config import to_tree
from monochord.core.ranges import Count
from monochord.evaluation.results import CLEAN, Results
from monochord.evaluation.scorecard import ErrorMap, error_map
from monochord.figures import _style
from monochord.figures._results import UNITS, in_condition, title_of
from monochord.figures.base import Measured
from monochord.metrics import LIMITS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure as Canvas


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorMapFigure(Measured):
    """Mean absolute error of position and force, as maps over true position and force.

    The scale ends at twice the paper's limits, 5 mm and 0.2 N. Cells without touches are blank; cells with
    too few estimates are crossed.

    Parameters
    ----------
    results
        The file ``results.npz`` from `monochord evaluate`.
    condition
        Condition to draw: "clean", or another condition of the results.
    least
        Smallest number of estimates for a cell to be drawn.
    """

    results: Path
    condition: str = CLEAN
    least: Count = 3

    def numbers(self) -> dict[str, Any]:
        """Return the cells of both maps."""
        results = in_condition(self.results, self.condition)
        about = {"simulated": results.simulated, "estimator": results.estimator}
        return about | {name: to_tree(errors) for name, errors in self._maps(results).items()}

    def draw(self) -> Canvas:
        """Read the results and draw both maps."""
        results = in_condition(self.results, self.condition)
        page = _style.canvas(84.0)
        panels = page.subplots(1, 2, sharey=True)
        for letter, axes, (name, errors) in zip("AB", panels, self._maps(results).items(), strict=True):
            factor, unit = UNITS[name]
            image = self._draw(axes, errors, factor)
            bar = page.colorbar(image, ax=axes, pad=0.02, aspect=24, extend="max")
            _style.dress_bar(bar, f"error of {name} ({unit})")
            up = "true F (N)" if letter == "A" else ""
            _style.dress(axes, letter, "", "true x (mm)", up)
        page.suptitle(title_of(results, self.condition), fontsize=_style.LABEL, color=_style.INK)
        return page

    def _maps(self, results: Results) -> dict[str, ErrorMap]:
        return {name: error_map(results, name, self.condition) for name in UNITS}

    def _draw(self, axes: Axes, errors: ErrorMap, factor: float) -> QuadMesh:
        error = factor * np.array([[np.nan if one is None else one for one in row] for row in errors.error])
        few = (np.array(errors.answered) < self.least) & (np.array(errors.windows) > 0)
        across, up = 1e3 * np.array(errors.positions), np.array(errors.forces)
        image = axes.pcolormesh(
            across, up, np.ma.masked_where(few | np.isnan(error), error), cmap="Oranges", vmin=0.0,
            vmax=2.0 * factor * LIMITS[errors.quantity], edgecolors="white", lw=0.3,
        )  # fmt: skip
        rows, columns = np.nonzero(few)
        middle = 0.5 * (across[1:] + across[:-1]), 0.5 * (up[1:] + up[:-1])
        axes.plot(middle[0][columns], middle[1][rows], ls="", marker="x", color=_style.PALE, ms=4.0, mew=0.7)
        for row, column in np.argwhere(~few & np.isfinite(error)).tolist():
            dark = error[row, column] > 1.4 * factor * LIMITS[errors.quantity]
            axes.text(
                float(middle[0][column]), float(middle[1][row]), f"{error[row, column]:.2g}", ha="center",
                va="center", fontsize=5.5, color="white" if dark else _style.INK,
            )  # fmt: skip
        axes.set(xlim=(across[0], across[-1]), ylim=(up[0], up[-1]))
        return image
