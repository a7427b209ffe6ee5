"""Estimates over time: each window's estimates combined with those of earlier windows of the same touch.

Everything here is a fold, state in and out, and leaves the estimates of single windows unchanged. Contact and
slip are decided (`monochord.live.switches`); position and force are those of the window, while a touch is
decided: the model's memory already has the windows before, and a mean over them would lag behind a slide. A
new touch restarts all of it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

from monochord.core.reasons import Reason
from monochord.core.types import Estimate, Estimates, Prediction
from monochord.core.units import Seconds
from monochord.live.switches import UNDECIDED, Switch, SwitchSettings, contact_after, slip_after

CONTACT, SLIP, POSITION, FORCE = "contact", "slip", "position", "force"
MIN_SHARE = 0.1
"""Smallest share of a window assumed to be touched once a touch shows."""
PATIENCE: Seconds = 0.2
"""How long a touch lasts without a position, of an estimator that tells no contact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterSettings:
    """Settings of the filter over time; see the module. The defaults were chosen on the twin."""

    contact: SwitchSettings = field(
        default_factory=lambda: SwitchSettings(on=0.6, off=0.4, average=0.01, dwell=0.01)
    )
    slip: SwitchSettings = field(
        default_factory=lambda: SwitchSettings(on=0.4, off=0.3, average=0.01, dwell=0.04)
    )


class FilterState(NamedTuple):
    """State of the filter on one stream, passed in and out; it starts as ``FilterState()``.

    `start` is the first frame of the last window and `time` its end in s. `onset` is the end of the present
    touch's first window, NaN without a touch. `placed` is the end of the last window with a position.
    """

    start: int = -1
    time: Seconds = math.nan
    onset: Seconds = math.nan
    contact: Switch = UNDECIDED
    slip: Switch = UNDECIDED
    placed: Seconds = -math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """The filter's output after a window.

    `estimates` are the tracked estimates, by the same names as a window's. `decided` holds ``contact`` and
    ``slip`` where known.
    """

    estimates: Estimates = field(default_factory=lambda: MappingProxyType({}))
    decided: Mapping[str, bool] = field(default_factory=lambda: MappingProxyType({}))


def step(
    state: FilterState, prediction: Prediction, length: Seconds, settings: FilterSettings
) -> tuple[FilterState, Tracked]:
    """Return the filter's state and output after a window.

    Parameters
    ----------
    state
        The state before the window. A window that does not begin after the previous one starts a new stream.
    prediction
        The window's prediction. Only contact, slip, position and force are tracked.
    length
        Length of the window in s.
    settings
        Settings of the filter.

    Examples
    --------
    >>> state, settings = FilterState(), FilterSettings()
    >>> for k in range(20):
    ...     estimates = {
    ...         "contact": Estimate(value=0.99, std=0.1, unit=""),
    ...         "position": Estimate(value=0.08, std=5e-4, unit="m"),
    ...     }
    ...     window = Prediction(start=441 * k, time=0.01 * k, estimates=estimates)
    ...     state, tracked = step(state, window, 0.1, settings)
    >>> tracked.estimates["position"].value, tracked.decided
    (0.08, {'contact': True})
    """
    if prediction.start <= state.start:
        state = FilterState()
    end, given = prediction.time + length, _usable(prediction.estimates)
    contact, onset = _touch(state, given, end, settings)
    slip = UNDECIDED
    if not math.isnan(onset) and SLIP in given:
        before = state.slip if onset == state.onset else UNDECIDED
        dt = length if math.isnan(state.time) else end - state.time
        share = min(max((end - onset + dt) / length, MIN_SHARE), 1.0)
        slip = slip_after(before, given[SLIP], end, onset, share, settings.slip)
    placed = end if POSITION in given and given[POSITION].valid else state.placed
    state = FilterState(prediction.start, end, onset, contact, slip, placed)
    return state, _output(state, given, settings)


def _usable(given: Estimates) -> Estimates:
    """Return estimates, with an abstention in place of each that is not a number."""
    if all(map(_is_usable, given.values())):
        return given
    return {
        name: each if _is_usable(each) else Estimate.abstain(each.unit, Reason.NOT_A_NUMBER)
        for name, each in given.items()
    }


def _is_usable(estimate: Estimate) -> bool:
    return not estimate.valid or (math.isfinite(estimate.value) and math.isfinite(estimate.std))


def _touch(
    state: FilterState, given: Estimates, end: Seconds, settings: FilterSettings
) -> tuple[Switch, Seconds]:
    """Return the contact after a window that ends at a time, and the touch's onset, NaN for none."""
    if CONTACT in given:
        return contact_after(state.contact, given[CONTACT], end, settings.contact)
    if POSITION in given and given[POSITION].valid:  # an estimator without: a touch is where a position is
        return UNDECIDED, end if math.isnan(state.onset) else state.onset
    return UNDECIDED, math.nan if end - state.placed > PATIENCE else state.onset


def _output(state: FilterState, given: Estimates, settings: FilterSettings) -> Tracked:
    """Return the estimates of a state, named as the window's estimates."""
    estimates, decided = dict[str, Estimate](), dict[str, bool]()
    contact, slip, touched = state.contact, state.slip, not math.isnan(state.onset)
    if CONTACT in given:
        touched = touched and contact.on is True
        if contact.on is None or state.time - contact.time > settings.contact.hold:
            estimates[CONTACT] = _missing(given[CONTACT], touched=touched)
        else:
            decided[CONTACT] = contact.on
            estimates[CONTACT] = _probability(contact, given[CONTACT].unit)
    if SLIP in given:
        if touched and slip.on is not None and state.time - slip.time <= settings.slip.hold:
            decided[SLIP] = slip.on
            estimates[SLIP] = _probability(slip, given[SLIP].unit)
        else:
            estimates[SLIP] = _missing(given[SLIP], touched=touched)
            if decided.get(CONTACT) is False:
                decided[SLIP] = False
    for name in (POSITION, FORCE):
        if name in given:
            raw = given[name]
            estimates[name] = raw if touched else _missing(raw, touched=touched)
    return Tracked(estimates=estimates, decided=decided)


def _missing(raw: Estimate, *, touched: bool) -> Estimate:
    """Return a window's abstention; where it does not abstain, one of a lost touch, or of none."""
    return raw if not raw.valid else Estimate.abstain(raw.unit, Reason.LOST if touched else Reason.NO_CONTACT)


def _probability(switch: Switch, unit: str) -> Estimate:
    value = switch.probability
    return Estimate(value=value, std=math.sqrt(value * (1.0 - value)), unit=unit)
