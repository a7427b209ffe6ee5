"""Scores of a run whose source provides the truth."""

from array import array
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from monochord.core.labels import SETTLED
from monochord.core.types import Floats
from monochord.core.units import Metres
from monochord.live.sinks.base import Listener, Update
from monochord.metrics import LIMITS, detection_score, regression_score

PROBABILITIES = ("contact", "slip")
QUANTITIES: Mapping[str, tuple[str, float, str]] = {
    "position": ("5mm", 1e3, "mm"),
    "force": ("0.2n", 1.0, "N"),
}
"""For each estimate: its error limit, display scale, and unit."""


class Scorer(Listener):
    """A sink that stores truth and estimates of every window, 13 numbers each, for runs of limited length.

    Window labels follow the rules of datasets (`monochord.core.labels`): a window in which a touch or a slide
    begins or ends has no label and does not count. `contact` and `slip` (sliding or resting, during contact)
    are right where the estimated probability is on the true side of 0.5, position and force where they are
    within `LIMITS` of the truth, over all contact, sliding or not. ``told`` is the share of windows with an
    estimate and ``right`` the share of these that are right, so that an abstention counts in the first alone;
    ``accuracy`` and ``within`` are shares of all windows.
    """

    def __init__(self) -> None:
        names = (*PROBABILITIES, *QUANTITIES)
        self._truth = {name: array("d") for name in ("settled", *names)}
        self._estimates = {name: (array("d"), array("d")) for name in names}
        self._named: set[str] = set()

    def write(self, update: Update) -> None:
        """Store truth and estimates of one window."""
        prediction, truth = update.prediction, update.truth
        self._named |= prediction.estimates.keys() & self._estimates.keys()
        known = {"settled": 1.0, **truth}
        for name, column in self._truth.items():
            column.append(known.get(name, np.nan))
        for name, columns in self._estimates.items():
            estimate = prediction.estimate(name)
            for column, value in zip(columns, (estimate.value, estimate.std), strict=True):
                column.append(value if estimate.valid else np.nan)

    def median_error(self) -> Metres:
        """Return the median absolute position error of settled windows; NaN where none counted."""
        errors = self._settled()
        answered = errors[np.isfinite(errors)]
        return float(np.median(np.abs(answered))) if len(answered) else float("nan")

    def tree(self) -> dict[str, float | int | None]:
        """Return the scores as plain values in SI units; None where no window counted."""
        settled = self._settled()
        answered = int(np.isfinite(settled).sum())
        score: dict[str, float | int | None] = {
            "median_error": self.median_error() if answered else None,
            "answered": answered,
            "abstained": len(settled) - answered,
        }
        contact, slip = self._label("contact"), self._label("slip")
        labelled, touched = np.isfinite(contact), contact > 0.0
        slip_labelled = touched & np.isfinite(slip)
        if "contact" in self._named:
            score |= {"contact_windows": int(labelled.sum()), **self._detection("contact", labelled)}
        for name, (within, _, _) in QUANTITIES.items():
            if name in self._named:
                score |= self._regression(name, touched & np.isfinite(self._label(name)), within)
        if "slip" in self._named:
            score |= {"slip_windows": int(slip_labelled.sum()), **self._detection("slip", slip_labelled)}
        return score

    def lines(self) -> list[str]:
        """Return the scores as text lines."""
        tree = self.tree()
        lines = [line for name in ("contact", *QUANTITIES, "slip") for line in _line(name, tree)]
        return lines if "slip" in self._named else [*self._settled_lines(), *lines]

    def _settled_lines(self) -> list[str]:
        """Return the scores of settled windows, for an estimator without slip, which needs steady sound."""
        errors = self._settled()
        answered = np.abs(errors[np.isfinite(errors)])
        abstained = len(errors) - len(answered)
        counted = f"settled windows with a touch: {len(answered)} answered, {abstained} abstained"
        if not len(answered):
            return [counted]
        within = float((answered <= LIMITS["position"]).mean())
        median = f"median {1e3 * self.median_error():.2f} mm, {_share(within)} within 5 mm"
        return [counted, f"position error against truth: {median}"]

    def _label(self, name: str) -> Floats:
        return np.array(self._truth[name])

    def _settled(self) -> Floats:
        """Return the position error of every settled window in contact, NaN for an abstention."""
        position = self._label("position")
        rows = (self._label("contact") > 0.0) & (self._label("settled") >= SETTLED) & np.isfinite(position)
        return (np.array(self._estimates["position"][0]) - position)[rows]

    def _detection(self, name: str, rows: NDArray[np.bool_]) -> dict[str, float | None]:
        """Return the shares told and right, and the area under the ROC curve where both classes occur."""
        score = detection_score(self._label(name)[rows] > 0.0, np.array(self._estimates[name][0])[rows])
        shares = _told_and_right(name, score.answered, score.accuracy)
        return {**shares, f"{name}_accuracy": score.accuracy, f"{name}_area": score.area}

    def _regression(self, name: str, rows: NDArray[np.bool_], within: str) -> dict[str, float | int | None]:
        value, std = (np.array(column)[rows] for column in self._estimates[name])
        score = regression_score(self._label(name)[rows], value, std, limit=LIMITS[name])
        return {
            f"{name}_windows": score.windows,
            **_told_and_right(name, score.answered, score.within),
            f"{name}_answered": int(np.isfinite(value).sum()),
            f"{name}_mae": score.mae,
            f"{name}_within_{within}": None if score.mae is None else score.within,
            f"{name}_coverage": score.coverage[0] if score.coverage else None,
        }


def _line(name: str, tree: Mapping[str, float | int | None]) -> list[str]:
    """Return the line of one quantity; empty where no window counted."""
    counted = tree.get(f"{name}_windows")
    if not counted:
        return []
    right = tree[f"{name}_right"]
    if right is None:
        return [f"{name:<9}told in none of {counted} windows"]
    told = f"{name:<9}told in {_share(tree[f'{name}_told'])} of {counted} windows, of these {_share(right)}"
    if name in PROBABILITIES:
        area = tree[f"{name}_area"]
        return [f"{told} right" + ("" if area is None else f"; area under the curve {area:.3f}")]
    (_, scale, unit), covered = QUANTITIES[name], tree[f"{name}_coverage"]
    coverage = "" if covered is None else f", {_share(covered)} within one standard error"
    error = f"mean error {scale * (tree[f'{name}_mae'] or 0.0):.2f} {unit}"
    return [f"{told} right within {scale * LIMITS[name]:g} {unit}; {error}{coverage}"]


def _told_and_right(name: str, told: float | None, right: float | None) -> dict[str, float | None]:
    """Return the share of windows with an estimate, and that of right ones among these.

    `right` is the share of right ones among all windows.

    >>> _told_and_right("force", 0.8, 0.6)
    {'force_told': 0.8, 'force_right': 0.75}
    """
    among = min(right / told, 1.0) if told and right is not None else None
    return {f"{name}_told": told, f"{name}_right": None if among is None else round(among, 12)}


def _share(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.1f} %"
