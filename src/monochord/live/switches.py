"""Decisions over time: contact and slip, by probabilities of window after window.

A touch lasts. So it is decided by averaged log odds, with two thresholds (hysteresis) and a time for which
the other side must have led (dwell). All times are in seconds, so another hop decides alike. A touch begins
at rest, and the slip of a window counts once most of the window is touched.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from monochord.core.errors import InputError
from monochord.core.ranges import Checked, InnerShare, NonNegative
from monochord.core.types import Estimate
from monochord.core.units import Seconds

MAX_LOGIT = 6.0
"""Largest log odds of a window: one window is never more certain than 400 to 1."""
TIME_TOLERANCE: Seconds = 1e-9
"""Times that differ by less are the same."""
SLIP_SHARE = 0.7
"""Share of a window that must be touched for its slip to count: the beginning of a touch sounds alike."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchSettings(Checked):
    """How a probability becomes a decision.

    Parameters
    ----------
    on, off
        Probability, averaged over time, from which it is on, and at which it is off again; 0 < off <= on < 1.
    average
        Time constant of the average of the log odds, in s.
    dwell
        For how long the average must have been on the other side, in s.
    hold
        After how long without any probability nothing is decided, in s.
    """

    on: InnerShare = 0.5
    off: InnerShare = 0.5
    average: NonNegative[Seconds] = 0.02
    dwell: NonNegative[Seconds] = 0.02
    hold: NonNegative[Seconds] = 0.5

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.off > self.on:
            raise InputError(f"filter thresholds on {self.on:g}, off {self.off:g}", "off at most on")


class Switch(NamedTuple):
    """A decision over time, after the window that ends at `time`.

    `on` is what was decided last, None before any; `since` is the onset, the end of the first window that
    showed it, and `decided` the end of the window after which it was decided. `level` are the averaged log
    odds. `turned` is the end of the first window of those that now show the other side, `led` since when
    the average does; NaN where it does not. `time` is that of the last window with a probability.
    """

    on: bool | None = None
    since: Seconds = math.nan
    decided: Seconds = math.nan
    level: float = 0.0
    turned: Seconds = math.nan
    led: Seconds = math.nan
    time: Seconds = -math.inf

    @property
    def probability(self) -> float:
        """The averaged probability."""
        return 1.0 / (1.0 + math.exp(-self.level))


UNDECIDED = Switch()


def switch(before: Switch, probability: float, time: Seconds, settings: SwitchSettings) -> Switch:
    """Return a switch after a window of a probability that ends at a time.

    >>> state, settings = UNDECIDED, SwitchSettings(average=0.0, dwell=0.02)
    >>> for k, probability in enumerate([0.1, 0.9, 0.9, 0.9]):
    ...     state = switch(state, probability, 0.01 * k, settings)
    >>> state.on, state.since, state.decided
    (True, 0.01, 0.03)
    """
    bounded = min(max(probability, 1e-9), 1.0 - 1e-9)
    logit = min(max(math.log(bounded / (1.0 - bounded)), -MAX_LOGIT), MAX_LOGIT)
    if before.on is None:
        return Switch(on=probability >= settings.on, since=time, decided=time, level=logit, time=time)
    share = 1.0 - math.exp((before.time - time) / settings.average) if settings.average > 0.0 else 1.0
    level = before.level + share * (logit - before.level)
    limit = settings.off if before.on else settings.on
    leads = (1.0 / (1.0 + math.exp(-level)) >= limit) is not before.on
    shows = (probability >= limit) is not before.on
    turned = (time if math.isnan(before.turned) else before.turned) if shows or leads else math.nan
    led = (time if math.isnan(before.led) else before.led) if leads else math.nan
    if leads and time - led >= settings.dwell - TIME_TOLERANCE:
        return Switch(on=not before.on, since=turned, decided=time, level=level, time=time)
    return Switch(before.on, before.since, before.decided, level, turned, led, time)


def contact_after(
    before: Switch, contact: Estimate, end: Seconds, settings: SwitchSettings
) -> tuple[Switch, Seconds]:
    """Return the contact after a window that ends at a time, and the onset of the touch, NaN for none."""
    forgotten = end - before.time > settings.hold
    if contact.valid:
        if before.on is not None and forgotten:
            before = before._replace(level=0.0, turned=math.nan, led=math.nan, time=end)
        before = switch(before, contact.value, end, settings)
    elif forgotten:
        return before, math.nan
    return before, before.since if before.on else before.turned


def slip_after(
    before: Switch, slip: Estimate, end: Seconds, onset: Seconds, share: float, settings: SwitchSettings
) -> Switch:
    """Return the slip after a window that the touch, from its onset on, covers only in part."""
    if before.on is None:
        level = math.log(settings.off / (1.0 - settings.off))
        return Switch(on=False, since=onset, decided=end, level=level, time=end)
    if not slip.valid:
        return before
    if share < SLIP_SHARE:
        return before._replace(time=end)  # what does not count does not average either
    return switch(before, slip.value, end, settings)
