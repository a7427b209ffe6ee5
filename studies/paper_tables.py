"""The paper's two tables as a figure: errors by feature and object, beside the paper's figures.

Makes `docs/figures/paper_tables.png` from rows of `monochord evaluate --rows` in two seconds::

    python -m studies.paper_tables --set rows=docs/results/paper.json --out docs/figures/paper_tables.png \
      --set 'features=["fft_harmonic","reading","log_mel","closed_form","ast random weights every 1 s"]'
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies._command import draw

from monochord.core.errors import InputError, did_you_mean
from monochord.evaluation import CLEAN
from monochord.evaluation.paper import NOISE, PAPER, RANDOM_WEIGHTS, PaperRow, reported
from monochord.figures import style
from monochord.figures.base import Measured

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

PANELS = {
    "position": ("position_mae_mm", "error of x (mm)", 1e3),
    "force": ("force_mae_n", "error of F (N)", 1.0),
}
"""Column, label, and factor from SI of each panel."""
COLUMNS = 4
"""Columns of the legend."""
MARKS = "osD"
"""One marker for each cycle of colours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperTables(Measured):
    """Mean absolute errors of position and force by feature and object; lines show the paper's sensor.

    Solid marks are without added noise, pale ones with `noise`.

    Parameters
    ----------
    rows
        The file from `monochord evaluate --rows`.
    noise
        Condition drawn beside the clean one; empty for none.
    features
        Features to draw, in this order; by default all in the file.
    """

    rows: Path
    noise: str = "music 10 dB"
    features: tuple[str, ...] = ()

    def numbers(self) -> dict[str, Any]:
        """Return the drawn errors, by quantity, condition, feature and object."""
        rows = self._read()
        return {
            quantity: {
                condition: {
                    feature: {row["object"]: row[column] for row in _of(rows, feature, condition)}
                    for feature in self._features(rows)
                }
                for condition in self._conditions()
            }
            for quantity, (column, _, _) in PANELS.items()
        }

    def draw(self) -> Canvas:
        """Draw both quantities, with a group of marks for each object."""
        from matplotlib.ticker import LogLocator, NullLocator  # noqa: PLC0415

        rows = self._read()
        bodies = [body for body in PAPER["position"] if any(row["object"] == body for row in rows)]
        bodies = bodies or list(dict.fromkeys(row["object"] for row in rows))
        page = style.canvas(85.0)
        panels = page.subplots(1, 2)
        for letter, axes, quantity in zip("AB", panels, PANELS, strict=True):
            column, label, factor = PANELS[quantity]
            style.dress(axes, letter, "", "", label)
            self._marks(axes, rows, bodies, column)
            self._paper_lines(axes, quantity, bodies, factor)
            axes.set_yscale("log")
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.yaxis.set_major_formatter("{x:g}")
            axes.yaxis.set_minor_locator(NullLocator())
            axes.set_xticks(range(len(bodies)), [body.replace("_", " ") for body in bodies])
        kind = "simulated" if all(row["simulated"] for row in rows) else "features by object"
        page.suptitle(f"{kind}; solid: clean, pale: {self.noise or 'none'}", fontsize=style.LABEL)
        style.key(page, *panels, columns=COLUMNS)
        return page

    def _conditions(self) -> list[str]:
        return [CLEAN, *filter(None, [self.noise])]

    def _features(self, rows: list[PaperRow]) -> list[str]:
        known = list(dict.fromkeys(row["feature"] for row in rows))
        for name in self.features:
            if name not in known:
                raise InputError(f"feature '{name}'", ", ".join(known), did_you_mean(name, known))
        return list(self.features) or known

    def _read(self) -> list[PaperRow]:
        try:
            rows: list[PaperRow] = json.loads(Path(self.rows).read_text(encoding="utf-8-sig"))
            conditions = {row["condition"] for row in rows}
        except (OSError, ValueError, TypeError, KeyError) as error:
            given = f"rows {self.rows} (missing or damaged)"
            raise InputError(given, "a file from monochord evaluate --rows") from error
        if self.noise and self.noise not in conditions:
            known = ", ".join(sorted(conditions))
            raise InputError(f"noise '{self.noise}'", known, did_you_mean(self.noise, conditions))
        return rows

    def _marks(self, axes: Axes, rows: list[PaperRow], bodies: list[str], column: str) -> None:
        features = self._features(rows)
        for number, feature in enumerate(features):
            aside = 0.7 * ((number + 0.5) / len(features) - 0.5)
            for condition in self._conditions():
                errors = {row["object"]: row[column] for row in _of(rows, feature, condition)}
                at = [place for place, body in enumerate(bodies) if errors.get(body) is not None]
                clean = condition == CLEAN
                across = [place + aside + (0.0 if clean else 0.03) for place in at]
                axes.plot(
                    across, [errors[bodies[place]] for place in at], ls="",
                    marker=MARKS[number // len(style.COLOURS) % len(MARKS)], ms=4.0, mec="none",
                    color=style.COLOURS[number % len(style.COLOURS)], alpha=1.0 if clean else 0.35,
                    label=_plain(feature) if clean else None,
                )  # fmt: skip

    def _paper_lines(self, axes: Axes, quantity: str, bodies: list[str], factor: float) -> None:
        for condition, dash in zip(self._conditions(), ("-", style.THEORY), strict=False):
            figures = [(place, reported(quantity, body, condition)) for place, body in enumerate(bodies)]
            lines = [(place, factor * one.mae) for place, one in figures if one is not None]
            if lines:
                places, errors = zip(*lines, strict=True)
                label = "the paper's sensor (real)" if condition == CLEAN else f"the same, {NOISE}"
                begins, ends = [place - 0.42 for place in places], [place + 0.42 for place in places]
                axes.hlines(errors, begins, ends, lw=1.0, color=style.INK, ls=dash, label=label)


def _plain(feature: str) -> str:
    """Return the name of a feature in a person's words.

    >>> _plain("ast random weights every 1 s"), _plain("fft_harmonic without tones")
    ('ast (random weights), a window a second', 'fft_harmonic without tones')
    """
    name = feature.replace(RANDOM_WEIGHTS, f" ({RANDOM_WEIGHTS.strip()})")
    return name.replace(" every 1 s", ", a window a second")


def _of(rows: list[PaperRow], feature: str, condition: str) -> list[PaperRow]:
    return [row for row in rows if (row["feature"], row["condition"]) == (feature, condition)]


if __name__ == "__main__":
    draw(PaperTables)
