"""Unseen builds: errors and coverage by how many touches of them are known, for each estimator."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.errors import InputError, did_you_mean
from monochord.evaluation.scorecard import EVERYTHING
from monochord.evaluation.summary import SummaryRow, read_summary
from monochord.figures import _style
from monochord.figures._results import COLOURS
from monochord.figures.base import Measured
from monochord.metrics import normal_coverage

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

PANELS = {
    "position_mae_mm": ("error of x (mm)", 1.0),
    "force_mae_n": ("error of F (N)", 1.0),
    "coverage_1se": ("within 1 std. error (%)", 1e2),
}
"""Of each panel the label and the factor of its column."""
HEIGHT = 62.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Builds(Measured):
    """Errors of position and force, and coverage, over the known touches, a line for each estimator.

    Shades are intervals of 95 % over builds. The dashed line is the coverage of normal errors whose size is
    stated rightly.

    Parameters
    ----------
    rows
        A file that ``monochord transfer --rows`` wrote.
    condition
        Which of its conditions; the first of the file by default.
    object
        Which object; by default all of them together.
    """

    rows: Path
    condition: str = ""
    object: str = EVERYTHING

    def numbers(self) -> dict[str, Any]:
        """Return what is drawn, by column, estimator and number of known touches."""
        rows = self._rows()
        return {
            column: {
                model: {str(row["touches"]): row[column] for row in rows if row["model"] == model}
                for model in dict.fromkeys(row["model"] for row in rows)
            }
            for column in PANELS
        }

    def draw(self) -> Canvas:
        """Draw the three panels beside each other."""
        rows = self._rows()
        counts = sorted({row["touches"] for row in rows})
        page = _style.canvas(HEIGHT)
        panels = page.subplots(1, len(PANELS))
        for letter, axes, (column, (label, factor)) in zip("ABC", panels, PANELS.items(), strict=True):
            _style.dress(axes, letter, "", "known touches", label)
            for number, model in enumerate(dict.fromkeys(row["model"] for row in rows)):
                own = [row for row in rows if row["model"] == model and row[column] is not None]
                _line(axes, own, column, factor, counts, COLOURS[number % len(COLOURS)])
            axes.set_xticks(range(len(counts)), [str(count) for count in counts])
            axes.set_ylim(bottom=0.0)
            axes.grid(axis="y", lw=0.3, color=_style.PALE)
        panels[2].axhline(100.0 * normal_coverage(1.0), lw=0.6, ls=_style.THEORY, color=_style.INK)
        panels[2].set_ylim(0.0, 100.0)
        kind = "simulated" if all(row.get("simulated") for row in rows) else "recorded"
        title = f"{kind}: {rows[0]['condition']}, {rows[0]['object'].replace('_', ' ')}"
        page.suptitle(title, fontsize=_style.LABEL)
        _style.key(page, *panels)
        return page

    def _rows(self) -> list[SummaryRow]:
        rows = read_summary(Path(self.rows))
        conditions = list(dict.fromkeys(row["condition"] for row in rows))
        condition = self.condition or conditions[0]
        if condition not in conditions:
            close = did_you_mean(condition, conditions)
            raise InputError(f"condition '{condition}'", ", ".join(conditions), close)
        own = [row for row in rows if row["condition"] == condition]
        objects = list(dict.fromkeys(row["object"] for row in own))
        if self.object not in objects:
            close = did_you_mean(self.object, objects)
            raise InputError(f"object '{self.object}'", ", ".join(objects), close)
        return [row for row in own if row["object"] == self.object]


def _line(
    axes: Axes, rows: list[SummaryRow], column: str, factor: float, counts: list[int], colour: str
) -> None:
    """Draw an estimator's figures over the counts, evenly spaced, with their intervals as a shade."""
    at = [counts.index(row["touches"]) for row in rows]
    label = rows[0]["model"].replace("_", " ") if rows else ""
    values = [factor * row[column] for row in rows]
    axes.plot(at, values, marker="o", ms=3.0, lw=1.0, mec="none", color=colour, label=label)
    bounds = [row.get("intervals", {}).get(column) or (row[column], row[column]) for row in rows]
    low, high = factor * np.array(bounds, float).reshape(-1, 2).T
    axes.fill_between(at, low, high, color=colour, alpha=0.15, lw=0)
