"""The hardware suite: errors, coverage and answers by condition, for each estimator."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from monochord.core.errors import InputError, did_you_mean
from monochord.evaluation.summary import SummaryRow, read_summary
from monochord.figures import _style
from monochord.figures._results import COLOURS
from monochord.figures.base import Measured
from monochord.metrics import normal_coverage

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

PANELS = {
    "position_mae_mm": ("error of x (mm)", 1.0, True),
    "force_mae_n": ("error of F (N)", 1.0, True),
    "coverage_1se": ("within 1 std. error (%)", 1e2, False),
    "answered": ("answered (%)", 1e2, False),
}
"""Of each panel the label, the factor of its column, and whether its axis is logarithmic."""
LINE_HEIGHT, MARGIN = 4.2, 26.0
"""Height in mm of a condition, and of all else."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware(Measured):
    """Errors of position and force, coverage, and the answered share, a line for each condition.

    The dashed line in the panel of coverage is that of normal errors whose size is stated rightly.

    Parameters
    ----------
    rows
        The file ``hardware.json`` that ``monochord evaluate MODEL --suite hardware`` wrote.
    models
        Estimators to draw, in this order; by default all of the file.
    """

    rows: Path
    models: tuple[str, ...] = ()

    def numbers(self) -> dict[str, Any]:
        """Return what is drawn, by column, estimator and condition."""
        rows = read_summary(Path(self.rows))
        return {
            column: {
                model: {row["condition"]: row[column] for row in rows if row["model"] == model}
                for model in self._models(rows)
            }
            for column in PANELS
        }

    def draw(self) -> Canvas:
        """Draw the four panels beside each other, over the same conditions."""
        from matplotlib.ticker import LogLocator, NullLocator  # noqa: PLC0415

        rows = read_summary(Path(self.rows))
        conditions = list(dict.fromkeys(row["condition"] for row in rows))
        page = _style.canvas(MARGIN + LINE_HEIGHT * len(conditions))
        panels = page.subplots(1, len(PANELS), sharey=True)
        for letter, axes, column in zip("ABCD", panels, PANELS, strict=True):
            label, _, logarithmic = PANELS[column]
            _style.dress(axes, letter, "", label, "")
            self._marks(axes, rows, conditions, column)
            if logarithmic:
                axes.set_xscale("log")
                axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
                axes.xaxis.set_major_formatter("{x:g}")
                axes.xaxis.set_minor_locator(NullLocator())
            else:
                axes.set_xlim(-4.0, 104.0)
            axes.grid(axis="y", lw=0.3, color=_style.PALE)
            axes.set_axisbelow(True)
        panels[2].axvline(100.0 * normal_coverage(1.0), lw=0.6, ls=_style.THEORY, color=_style.INK)
        panels[0].set_yticks(range(len(conditions)), conditions)
        panels[0].set_ylim(len(conditions) - 0.5, -0.5)
        kind = "simulated" if all(row.get("simulated") for row in rows) else "conditions"
        page.suptitle(f"{kind}: one sensor, one thing changed", fontsize=_style.LABEL)
        _style.key(page, *panels)
        return page

    def _marks(self, axes: Axes, rows: list[SummaryRow], conditions: list[str], column: str) -> None:
        _, factor, _ = PANELS[column]
        models = self._models(rows)
        for number, model in enumerate(models):
            own = {row["condition"]: row[column] for row in rows if row["model"] == model}
            at = [place for place, condition in enumerate(conditions) if own.get(condition) is not None]
            aside = 0.5 * ((number + 0.5) / len(models) - 0.5)
            axes.plot(
                [factor * own[conditions[place]] for place in at], [place + aside for place in at],
                ls="", marker="o", ms=3.0, mec="none", color=COLOURS[number % len(COLOURS)],
                label=model.replace("_", " "),
            )  # fmt: skip

    def _models(self, rows: list[SummaryRow]) -> list[str]:
        known = list(dict.fromkeys(row["model"] for row in rows))
        for name in self.models:
            if name not in known:
                raise InputError(f"estimator '{name}'", ", ".join(known), did_you_mean(name, known))
        return list(self.models) or known
