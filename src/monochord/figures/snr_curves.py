"""Scores over the level of added noise, by noise kind."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.ranges import Whole
from monochord.evaluation.results import CLEAN, Results, read_results
from monochord.evaluation.scores import Score, detection, regression
from monochord.figures import _style
from monochord.figures._results import title_of
from monochord.figures.base import Measured

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

PANELS = {
    "position": ("error of x (mm)", 1e3),
    "force": ("error of F (N)", 1.0),
    "contact": ("accuracy of contact (%)", 1e2),
    "slip": ("slip: area under the curve", 1.0),
}
"""Axis label of each panel, and the factor from SI to its unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SnrCurves(Measured):
    """Errors of position and force, accuracy of contact, and area under the curve of slip, over added noise.

    Noise was added to whole sessions at given signal-to-noise ratios; the dashed line is without noise.
    Errors are over answered windows, so read them with the answered share: see `--json`.

    Parameters
    ----------
    results
        The file ``results.npz`` from `monochord evaluate`, with its noise suite.
    draws
        Bootstrap draws for 95 % intervals, drawn as bars; 0 for none.
    """

    results: Path
    draws: Whole = 0

    def numbers(self) -> dict[str, Any]:
        """Return, for each noise and ratio in dB, each panel's value, low, high and answered share."""
        results = read_results(Path(self.results))
        about = {"simulated": results.simulated, "estimator": results.estimator}
        return about | {"curves": self._curves(results)}

    def draw(self) -> Canvas:
        """Score the results by noise and ratio, and draw the four panels."""
        results = read_results(Path(self.results))
        curves = self._curves(results)
        page = _style.canvas(120.0)
        panels = page.subplots(2, 2, sharex=True).ravel()
        for letter, axes, (name, (label, factor)) in zip("ABCD", panels, PANELS.items(), strict=True):
            low = letter in "CD"
            _style.dress(axes, letter, "", "signal-to-noise ratio (dB)" if low else "", label)
            if not _draw(axes, curves, name, factor):
                axes.text(0.5, 0.5, "not estimated", transform=axes.transAxes, ha="center", color=_style.PALE)
            if name in ("position", "force"):
                axes.set_ylim(bottom=0.0)
            else:
                axes.set_ylim(top=1.02 * factor)
        page.suptitle(title_of(results), fontsize=_style.LABEL, color=_style.INK)
        _style.key(page, *panels)
        return page

    def _curves(self, results: Results) -> list[dict[str, Any]]:
        kinds = dict.fromkeys((each.noise, each.ratio) for each in results.trials)
        added = [(noise, ratio) for noise, ratio in kinds if noise and ratio is not None]
        if not added:
            raise InputError(f"results {self.results} without added noise", "results of a noise suite")
        noises, ratios = results.of_trials("noise"), results.of_trials("ratio").astype(np.float64)
        rows = {(CLEAN, None): results.of_trials("condition") == CLEAN}
        rows |= {(noise, ratio): (noises == noise) & (ratios == ratio) for noise, ratio in added}
        return [
            {"noise": noise, "ratio": ratio} | self._scores(results, at)
            for (noise, ratio), at in rows.items()
            if at.any()
        ]

    def _scores(self, results: Results, at: np.ndarray) -> dict[str, Any]:
        scores: dict[str, Any] = {}
        for name in ("position", "force"):
            one = regression(results, name, at, draws=self.draws)
            scores[name] = _plain(one.mae, one.answered)
        for name in ("contact", "slip"):
            one = detection(results, name, at, draws=self.draws)
            scores[name] = _plain(one.accuracy if name == "contact" else one.area, one.answered)
        return scores


def _plain(score: Score, answered: float | None) -> dict[str, float | None]:
    return {"value": score.value, "low": score.low, "high": score.high, "answered": answered}


def _draw(axes: Axes, curves: list[dict[str, Any]], name: str, factor: float) -> bool:
    """Draw one panel; return whether there were data to draw."""
    noises = list(dict.fromkeys(one["noise"] for one in curves if one["ratio"] is not None))
    for number, noise in enumerate(noises):
        points = [
            (float(one["ratio"]), one[name])
            for one in curves
            if one["noise"] == noise and one["ratio"] is not None and one[name]["value"] is not None
        ]
        line = sorted(points, key=lambda point: point[0])
        if not line:
            continue
        value = factor * np.array([one["value"] for _, one in line])
        ends = [
            [one["value"] if one[end] is None else one[end] for _, one in line] for end in ("low", "high")
        ]
        bars = np.abs(factor * np.array(ends) - value)
        axes.errorbar(
            [ratio for ratio, _ in line], value, yerr=bars if bars.any() else None, lw=1.1, marker="o",
            ms=3.0, elinewidth=0.6, color=_style.COLOURS[number % len(_style.COLOURS)], label=noise,
        )  # fmt: skip
    for one in curves:
        if one["noise"] == CLEAN and one[name]["value"] is not None:
            axes.axhline(factor * one[name]["value"], color=_style.INK, lw=0.8, ls=_style.THEORY, label=CLEAN)
    return any(one[name]["value"] is not None for one in curves)
