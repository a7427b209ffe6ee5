"""The error of a run against what its source knows to be true."""

import statistics
from array import array

from monochord.sinks.base import Listener, Moment
from monochord.units import Metres


class Score(Listener):
    """A sink that keeps the position error of every settled window with a touch.

    A window counts where the truth has a contact at a known position and does not say that it is unsettled.
    The errors take 8 bytes a window: this is for runs that end.
    """

    def __init__(self) -> None:
        self.errors = array("d")
        self.abstained = 0

    def write(self, moment: Moment) -> None:
        """Keep the error of one window."""
        truth = moment.truth
        if not truth.get("contact") or not truth.get("settled", 1.0) or "position" not in truth:
            return
        position = moment.prediction.estimate("position")
        if position.valid:
            self.errors.append(position.value - truth["position"])
        else:
            self.abstained += 1

    def median_error(self) -> Metres:
        """Return the median size of the error; NaN where no window counted."""
        return statistics.median(map(abs, self.errors)) if self.errors else float("nan")

    def tree(self) -> dict[str, float | int | None]:
        """Return the score as plain values, in metres; the median is None where no window counted."""
        median = self.median_error() if self.errors else None
        return {"median_error": median, "answered": len(self.errors), "abstained": self.abstained}

    def lines(self) -> list[str]:
        """Return the score as lines of text."""
        answered = len(self.errors)
        counted = f"settled windows with a touch: {answered} answered, {self.abstained} abstained"
        if not answered:
            return [counted]
        within = sum(abs(e) <= 5e-3 for e in self.errors) / answered
        error = f"median {1e3 * self.median_error():.2f} mm, {100 * within:.1f} % within 5 mm"
        return [counted, f"position error against truth: {error}"]
