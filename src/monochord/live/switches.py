"""Decisions over time: contact and slip from the probabilities of successive windows.

A touch lasts. So the decision uses averaged log odds, two thresholds (hysteresis) and a minimum time on the
other side (dwell). All times are in seconds, so that the hop does not matter. A touch begins at rest, and a
window's slip counts once most of the window is in contact.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from monochord.core.errors import InputError
from monochord.core.ranges import Checked, InnerShare, NonNegative
from monochord.core.types import Estimate
from monochord.core.units import Seconds

MAX_LOGIT = 6.0
"""Largest log odds of a window: a single window is at most 400 to 1 certain."""
TIME_TOLERANCE: Seconds = 1e-9
"""Times closer than this are equal, in s."""
SLIP_SHARE = 0.7
"""Share of a window in contact for its slip to count: the onset of a touch sounds like slip."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchSettings(Checked):
    """Settings that turn probabilities into a decision.

    Parameters
    ----------
    on, off
        Thresholds of the averaged probability for switching on and off; 0 < off <= on < 1.
    average
        Time constant of the averaged log odds, in s.
    dwell
        How long the average must stay on the other side, in s.
    hold
        Time without any probability after which the state is undecided, in s.
    """

    on: InnerShare = 0.5
    off: InnerShare = 0.5
    average: NonNegative[Seconds] = 0.02
    dwell: NonNegative[Seconds] = 0.02
    hold: NonNegative[Seconds] = 0.5

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.off > self.on:
            raise InputError(f"filter thresholds on {self.on:g}, off {self.off:g}", "off no larger than on")


class Switch(NamedTuple):
    """A decision over time, after the window that ends at `time`.

    `on` is the last decision, None before any. `since` is the onset, the end of the first window that showed
    the change, and `decided` the end of the window after which it was decided. `level` holds the averaged log
    odds. `turned` is the end of the first window now on the other side, `led` the time since which the
    average is; NaN where it is not. `time` is that of the last window with a probability.
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
    """Return a switch after a window that ends at a time, with its probability.

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
    """Return the contact after a window that ends at a time, and the touch's onset, NaN for none."""
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
    """Return the slip after a window only partly in contact, from the touch's onset on."""
    if before.on is None:
        level = math.log(settings.off / (1.0 - settings.off))
        return Switch(on=False, since=onset, decided=end, level=level, time=end)
    if not slip.valid:
        return before
    if share < SLIP_SHARE:
        return before._replace(time=end)  # what does not count does not average either
    return switch(before, slip.value, end, settings)
