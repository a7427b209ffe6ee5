"""Counts of detected, missed and false contact and slip, and of abstentions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.types import Floats
from monochord.evaluation.results import CLEAN, Results
from monochord.evaluation.scores import detection_rows
from monochord.figures import _style
from monochord.figures._results import in_condition, title_of
from monochord.figures.base import Measured
from monochord.metrics import DECISION, confusion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

QUESTIONS = {"contact": ("untouched", "touched"), "slip": ("at rest", "sliding")}
"""Estimates, with the names of their negative and positive class."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Confusion(Measured):
    """Counts of windows by truth and answer, of contact and slip; a probability above 0.5 is positive.

    The shade is the share of windows with that truth. Abstentions have a separate column.

    Parameters
    ----------
    results
        The file ``results.npz`` from `monochord evaluate`.
    condition
        Condition to draw: "clean", or another condition of the results.
    """

    results: Path
    condition: str = CLEAN

    def numbers(self) -> dict[str, Any]:
        """Return counts by truth (no, yes), each by answer (no, yes, none)."""
        results = in_condition(self.results, self.condition)
        about = {"simulated": results.simulated, "estimator": results.estimator, "condition": self.condition}
        return about | {name: _counts(results, name).astype(int).tolist() for name in QUESTIONS}

    def draw(self) -> Canvas:
        """Read the results and draw both tables."""
        results = in_condition(self.results, self.condition)
        page = _style.canvas(62.0)
        panels = page.subplots(1, 2)
        for letter, axes, (name, kinds) in zip("AB", panels, QUESTIONS.items(), strict=True):
            _draw(axes, _counts(results, name), kinds)
            _style.dress(axes, letter, name, "estimate", "truth")
        page.suptitle(title_of(results, self.condition), fontsize=_style.LABEL, color=_style.INK)
        return page


def _counts(results: Results, name: str) -> Floats:
    """Return counts (2, 3) by truth and estimate."""
    part = results.where(detection_rows(results, name))
    truth, estimate = part.label(name) == 1.0, part.estimate(name)
    silent = np.isnan(estimate)
    counts = np.zeros((2, 3))
    counts[:, 2] = np.count_nonzero(silent & ~truth), np.count_nonzero(silent & truth)
    if not silent.all():
        counts[:, :2] = confusion(truth[~silent], estimate[~silent] >= DECISION)
    return counts


def _draw(axes: Axes, counts: Floats, kinds: tuple[str, str]) -> None:
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for (row, column), count in np.ndenumerate(counts):
        share = shares[row, column]
        axes.text(
            column, row, f"{count:.0f}\n{100.0 * share:.1f} %", ha="center", va="center",
            fontsize=_style.LABEL, color="white" if share > 0.6 else _style.INK,
        )  # fmt: skip
    axes.set_xticks(range(3), [*kinds, "no estimate"])
    axes.set_yticks(range(2), kinds)
