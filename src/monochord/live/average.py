"""A short average of a quantity over the windows of a touch.

- **Average.** Each estimate counts by 1 / std^2, and exponentially less with age. Overlapping windows share
  most of their error, so the standard error is that of a typical estimate in the average.
- **Hold.** When windows abstain during a touch, the average is kept for a short time, with a growing standard
  error, if two windows or more have made it. Outside the sensing range it ends at once.
- **Jump.** An estimate many standard errors away is dropped. If the next one agrees with it, the average
  restarts there.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from monochord.core.ranges import Checked, NonNegative, Positive
from monochord.core.reasons import Reason
from monochord.core.types import Estimate
from monochord.core.units import Seconds
from monochord.live.switches import TIME_TOLERANCE

MIN_STD, MAX_STD = 1e-6, 1e6
"""Standard errors of an estimate are taken as within these, in its unit, so that weights are finite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AverageSettings(Checked):
    """Settings of an average over time.

    Parameters
    ----------
    average
        Time constant of the average, in s; 0 takes the newest estimate.
    gate
        Standard errors beyond which an estimate needs a second one to be believed.
    coast
        How long the average is held without estimates, in s.
    """

    average: NonNegative[Seconds] = 0.01
    gate: Positive[float] = 5.0
    coast: NonNegative[Seconds] = 0.2


class Average(NamedTuple):
    """A weighted average after a window.

    `number` is the number of estimates and `weight` the sum of their 1 / std^2, both less by age. `time` is
    the end of the last window that counts, and `rival` the last estimate if it was dropped.
    """

    value: float
    number: float
    weight: float
    time: Seconds
    rival: "Average | None" = None

    @property
    def std(self) -> float:
        """The standard error of a typical estimate in the average."""
        return math.sqrt(self.number / self.weight)

    def estimate(self, unit: str, end: Seconds, settings: AverageSettings) -> Estimate:
        """Return the average after a window's end; its standard error doubles over a hold."""
        held = (end - self.time) / max(settings.coast, TIME_TOLERANCE)
        return Estimate(value=self.value, std=self.std * (1.0 + held), unit=unit)

    def is_near(self, other: "Average", gate: float) -> bool:
        """Return whether two averages differ by no more than `gate` standard errors."""
        return abs(self.value - other.value) <= gate * math.hypot(self.std, other.std)


def average_after(
    before: Average | None, estimate: Estimate, end: Seconds, share: float, settings: AverageSettings
) -> Average | None:
    """Return the average after a window that ends at a time, None for none.

    The standard error of a window with only a `share` in contact is std / share.
    """
    if before is not None:
        coast = settings.coast if before.number > 1.0 or estimate.valid else 0.0
        is_outside = Reason.of(estimate.reason) is Reason.OUTSIDE_RANGE
        is_over = is_outside or end - before.time > coast + TIME_TOLERANCE
        before = None if is_over else before
    if not estimate.valid:
        return before
    std = min(max(estimate.std, MIN_STD), MAX_STD) / share
    newest = Average(estimate.value, 1.0, std**-2, end)
    if before is None:
        return newest
    if not before.is_near(newest, settings.gate):
        if before.rival is None or not before.rival.is_near(newest, settings.gate):
            return before._replace(rival=newest)
        before = before.rival
    keep = math.exp((before.time - end) / settings.average) if settings.average else 0.0
    weight = keep * before.weight + newest.weight
    value = before.value + (newest.value - before.value) * newest.weight / weight
    return Average(value, keep * before.number + 1.0, weight, end)
