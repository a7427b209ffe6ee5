"""Estimates over time: what one window says, weighed with what the windows before it said of the same touch.

Everything here is a fold, state in and out, and the estimates of single windows stay as they are beside it.
Contact and slip are decided (`monochord.live.switches`), position and force are tracked
(`monochord.live.tracks`). A touch that begins starts all of it anew.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

from monochord.core.types import Estimate, Estimates, Prediction
from monochord.core.units import Seconds
from monochord.live.switches import UNDECIDED, Switch, SwitchSettings, contact_after, slip_after
from monochord.live.tracks import ForceSettings, Press, Span, Track, TrackSettings, press_after, track_after

CONTACT, SLIP, POSITION, FORCE = "contact", "slip", "position", "force"
LOST = "lost"
"""The reason where a track has gone on too long without an estimate, if the window gives none itself."""
UNTOUCHED = "no contact"
"""The reason where nothing touches, if the window gives none itself."""
NO_NUMBER = "not a number"
"""The reason where an estimator states no number."""
MIN_SHARE = 0.1
"""Least share of a window that is taken to be touched once a touch shows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterSettings:
    """How estimates are followed over time; see the module. The defaults were chosen on the twin."""

    contact: SwitchSettings = field(
        default_factory=lambda: SwitchSettings(on=0.6, off=0.4, average=0.01, dwell=0.01)
    )
    slip: SwitchSettings = field(
        default_factory=lambda: SwitchSettings(on=0.15, off=0.1, average=0.01, dwell=0.1)
    )
    position: TrackSettings = field(default_factory=TrackSettings)
    force: ForceSettings = field(default_factory=ForceSettings)


class FilterState(NamedTuple):
    """The state of the filter on one stream, passed in and out; it begins as ``FilterState()``.

    `start` is the first frame of the last window and `time` its end in s. `onset` is the end of the first
    window of the present touch, NaN without one.
    """

    start: int = -1
    time: Seconds = math.nan
    onset: Seconds = math.nan
    contact: Switch = UNDECIDED
    slip: Switch = UNDECIDED
    position: Track | None = None
    force: Press | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """What the filter says after a window.

    `estimates` are the tracked ones, by the names of those of a window. `decided` holds ``contact`` and
    ``slip`` where they are known.
    """

    estimates: Estimates = field(default_factory=lambda: MappingProxyType({}))
    decided: Mapping[str, bool] = field(default_factory=lambda: MappingProxyType({}))


def step(
    state: FilterState, prediction: Prediction, length: Seconds, settings: FilterSettings
) -> tuple[FilterState, Tracked]:
    """Return the state after a window, and the tracked touch.

    Parameters
    ----------
    state
        The state before the window. A window that does not begin after the one before begins a new stream.
    prediction
        Of the window. Estimates of other names than contact, slip, position and force are not tracked.
    length
        Of the window in s.
    settings
        How estimates are followed.

    Examples
    --------
    >>> state, settings = FilterState(), FilterSettings()
    >>> for k in range(20):
    ...     estimates = {
    ...         "contact": Estimate(value=0.99, std=0.1, unit=""),
    ...         "position": Estimate(value=0.08 if k != 15 else 0.14, std=5e-4, unit="m"),
    ...     }
    ...     window = Prediction(start=441 * k, time=0.01 * k, estimates=estimates)
    ...     state, tracked = step(state, window, 0.1, settings)
    ...     if k == 15:
    ...         print(round(tracked.estimates["position"].value, 4), tracked.decided)
    0.08 {'contact': True}
    """
    if prediction.start <= state.start:
        state = FilterState()
    end, given = prediction.time + length, _usable(prediction.estimates)
    contact, onset = _touch(state, given, end, settings)
    slip, track, press = UNDECIDED, None, None
    if not math.isnan(onset):
        before = state if onset == state.onset else FilterState()
        dt = length if math.isnan(state.time) else end - state.time
        share = min(max((end - onset + dt) / length, MIN_SHARE), 1.0)
        span, sliding = Span(end, dt, max(length / dt, 1.0), share), 1.0
        if SLIP in given:
            slip = slip_after(before.slip, given[SLIP], end, onset, share, settings.slip)
            if given[SLIP].valid:  # what the window does not say may be anything
                sliding = min(slip.probability / settings.slip.on, 1.0)
        if POSITION in given:
            track = track_after(before.position, given[POSITION], span, sliding, settings.position)
        if FORCE in given:
            press = press_after(before.force, given[FORCE], span, settings.force, slides=slip.on is True)
    state = FilterState(prediction.start, end, onset, contact, slip, track, press)
    return state, _said(state, given, settings)


def _usable(given: Estimates) -> Estimates:
    """Return estimates with those that are no numbers as abstentions, whatever the estimator called them."""
    if all(map(_is_usable, given.values())):
        return given
    return {
        name: each if _is_usable(each) else Estimate.abstain(each.unit, NO_NUMBER)
        for name, each in given.items()
    }


def _is_usable(estimate: Estimate) -> bool:
    return not estimate.valid or (math.isfinite(estimate.value) and math.isfinite(estimate.std))


def _touch(
    state: FilterState, given: Estimates, end: Seconds, settings: FilterSettings
) -> tuple[Switch, Seconds]:
    """Return the contact after a window that ends at a time, and the onset of the touch, NaN for none."""
    if CONTACT in given:
        return contact_after(state.contact, given[CONTACT], end, settings.contact)
    if POSITION in given and given[POSITION].valid:  # an estimator without: a touch is where a position is
        return UNDECIDED, end if math.isnan(state.onset) else state.onset
    lost = state.position is None or end - state.position.seen > settings.position.coast
    return UNDECIDED, math.nan if lost else state.onset


def _said(state: FilterState, given: Estimates, settings: FilterSettings) -> Tracked:
    """Return the estimates of a state, for a window of these estimates."""
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
    if POSITION in given:
        raw, track = given[POSITION], state.position
        estimates[POSITION] = (
            track.estimate(raw.unit, settings.position)
            if touched and track is not None
            else _missing(raw, touched=touched)
        )
    if FORCE in given:
        raw, press = given[FORCE], state.force
        estimates[FORCE] = (
            press.estimate(raw.unit) if touched and press is not None else _missing(raw, touched=touched)
        )
    return Tracked(estimates=estimates, decided=decided)


def _missing(raw: Estimate, *, touched: bool) -> Estimate:
    """Return the abstention of a window, or one of the filter's own where the window does not abstain."""
    return raw if not raw.valid else Estimate.abstain(raw.unit, LOST if touched else UNTOUCHED)


def _probability(switch: Switch, unit: str) -> Estimate:
    value = switch.probability
    return Estimate(value=value, std=math.sqrt(value * (1.0 - value)), unit=unit)
