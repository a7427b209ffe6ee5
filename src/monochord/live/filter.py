"""Estimates over time: what one window says, weighed with what the windows before it said of the same touch.

Everything here is a fold, state in and out, and the estimates of single windows stay as they are beside it.
Four things are known beforehand:

- **A touch lasts.** Contact and slip are decided by averaged log odds, with two thresholds (hysteresis) and a
  time for which the other side must have led (dwell). All times are in seconds, so another hop decides alike.
- **It moves continuously.** Position is a Kalman filter with a nearly constant velocity (Bar-Shalom, Li and
  Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, ch. 6) that changes freely
  while the touch slides and hardly at rest. An abstention leaves a prediction whose uncertainty grows.
- **The driven string may lock to another mode, and an estimate then jumps.** An estimate outside the gate
  does not move the track. It founds a rival, which later estimates support or oppose; the track changes to
  it once the support has lasted. Until then the standard error covers both.
- **Most of an error stays as long as the touch.** Of the variance that an estimate states, a share is an
  offset of this object on this sensor, which no averaging removes; the rest fluctuates. Windows of length
  T that begin dt apart overlap: averaging them is worth that of independent ones of the variance times T / dt
  (the integral of their triangular autocorrelation), and so much noise is what the filter assumes. For
  force the offset at rest and that while sliding are two unknowns with one force below them. So what was
  learned at rest still holds when the object slides, where an estimate alone may be far off.

A touch that begins starts all of it anew.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from monochord.core.errors import InputError
from monochord.core.types import Estimate, Estimates, Prediction
from monochord.core.units import Metres, Seconds

CONTACT, SLIP, POSITION, FORCE = "contact", "slip", "position", "force"
MAX_LOGIT = 6.0
"""Largest log odds of a window: one window is never more certain than 400 to 1."""
MIN_STD = 1e-9
"""Least standard error of an estimate, in its unit, so that none divides by zero."""
LOST = "lost"
"""The reason where a track has gone on too long without an estimate, if the window gives none itself."""


def _refuse_time(name: str, value: Seconds) -> None:
    if not 0.0 <= value < math.inf:
        raise InputError(f"filter {name} {value:g} s", "0 s or more")


def _refuse_share(name: str, value: float) -> None:
    if not 0.0 <= value < 1.0:
        raise InputError(f"filter {name} {value:g}", "a share of 0 or more, below 1")


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchSettings:
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

    on: float = 0.5
    off: float = 0.5
    average: Seconds = 0.02
    dwell: Seconds = 0.02
    hold: Seconds = 0.5

    def __post_init__(self) -> None:
        if not 0.0 < self.off <= self.on < 1.0:
            given = f"filter thresholds on {self.on:g}, off {self.off:g}"
            raise InputError(given, "probabilities above 0 and below 1, off at most on")
        for name in ("average", "dwell", "hold"):
            _refuse_time(name, getattr(self, name))


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackSettings:
    """How a position is tracked.

    Parameters
    ----------
    offset
        Share of an estimate's variance that is an offset of the touch, 0 to 1.
    sliding, resting
        How freely the velocity changes: the spectral density of the acceleration in m^2 / s^3.
    gate
        Standard errors from which an estimate is a rival's, and no more the track's.
    believe
        For how long estimates must have contradicted an established track, net, for it to jump, in s.
    coast
        For how long a track is predicted without any estimate, in s.
    """

    offset: float = 0.9
    sliding: float = 5e-3
    resting: float = 5e-3
    gate: float = 5.0
    believe: Seconds = 0.15
    coast: Seconds = 0.2

    def __post_init__(self) -> None:
        _refuse_share("offset", self.offset)
        if not (min(self.sliding, self.resting) > 0.0 and self.gate > 0.0):
            raise InputError(f"filter sliding {self.sliding:g}, gate {self.gate:g}", "above 0")
        for name in ("believe", "coast"):
            _refuse_time(name, getattr(self, name))


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSettings:
    """How a force is tracked.

    Parameters
    ----------
    offset
        Share of an estimate's variance that is an offset of the touch, 0 to 1.
    common
        Correlation of the offset at rest with that while sliding, 0 to 1.
    change
        How freely a force changes: the variance that a second adds, in N^2 / s.
    coast
        For how long it is predicted without any estimate, in s.
    """

    offset: float = 0.9
    common: float = 0.8
    change: float = 1.0
    coast: Seconds = 0.3

    def __post_init__(self) -> None:
        _refuse_share("offset", self.offset)
        _refuse_share("common", self.common)
        if not self.change > 0.0:
            raise InputError(f"filter change {self.change:g} N^2/s", "above 0")
        _refuse_time("coast", self.coast)


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterSettings:
    """How estimates are followed over time; see the module. The defaults were chosen on the twin."""

    contact: SwitchSettings = SwitchSettings(on=0.6, off=0.4, average=0.01, dwell=0.01)
    slip: SwitchSettings = SwitchSettings(on=0.35, off=0.25, average=0.05, dwell=0.02)
    position: TrackSettings = TrackSettings()
    force: ForceSettings = ForceSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch:
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
        on = probability >= settings.on
        return Switch(on=on, since=time, decided=time, level=logit, time=time)
    share = 1.0 - math.exp((before.time - time) / settings.average) if settings.average > 0.0 else 1.0
    level = before.level + share * (logit - before.level)
    average = 1.0 / (1.0 + math.exp(-level))
    limit = settings.off if before.on else settings.on
    leads = average < limit if before.on else average >= limit
    shows = probability < limit if before.on else probability >= limit
    turned = (time if math.isnan(before.turned) else before.turned) if shows or leads else math.nan
    led = (time if math.isnan(before.led) else before.led) if leads else math.nan
    if leads and time - led >= settings.dwell - 1e-9:
        return Switch(on=not before.on, since=turned, decided=time, level=level, time=time)
    return Switch(
        on=before.on,
        since=before.since,
        decided=before.decided,
        level=level,
        turned=turned,
        led=led,
        time=time,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A position over time, after the window that ends at `time`.

    `place` in m and `velocity` in m/s have the covariance `place_var`, `cross`, `velocity_var`. `offset` is
    the variance of what stays as long as the touch. `trust` is for how long estimates have supported the
    track, net, in s; those that did not support a rival at `rival` of variance `rival_var`, NaN for none.
    `seen` is the time of the last estimate.
    """

    place: Metres
    velocity: float
    place_var: float
    cross: float
    velocity_var: float
    offset: float
    time: Seconds
    seen: Seconds
    trust: Seconds
    rival: Metres = math.nan
    rival_var: float = math.nan


START_VELOCITY = 0.01
"""Standard deviation of a velocity before any is known, in m/s."""
STOP: Seconds = 0.03
"""Time in which the velocity of a touch at rest falls by e."""
RIVAL_DRIFT = 1e-5
"""Variance in m^2 that a second adds to a rival's place."""


def _track_from(place: Metres, variance: float, time: Seconds, trust: Seconds, offset: float) -> Track:
    """Return the track that an estimate founds, of whose variance a share is an offset."""
    return Track(
        place=place,
        velocity=0.0,
        place_var=(1.0 - offset) * variance,
        cross=0.0,
        velocity_var=START_VELOCITY**2,
        offset=offset * variance,
        time=time,
        seen=time,
        trust=trust,
    )


def _predicted(track: Track, time: Seconds, sliding: float, settings: TrackSettings) -> Track:
    """Return a track at a later time, as of a touch that slides with a probability."""
    dt = time - track.time
    density = settings.resting + sliding * sliding * (settings.sliding - settings.resting)
    keep = math.exp(-dt * (1.0 - sliding) / STOP)  # at rest a velocity ends
    travel = dt * keep
    a, b, c = track.place_var, track.cross, track.velocity_var
    return Track(
        place=track.place + travel * track.velocity,
        velocity=keep * track.velocity,
        place_var=a + 2.0 * travel * b + travel * travel * c + density * dt**3 / 3.0,
        cross=keep * (b + travel * c) + density * dt**2 / 2.0,
        velocity_var=keep * keep * c + density * dt,
        offset=track.offset,
        time=time,
        seen=track.seen,
        trust=track.trust,
        rival=track.rival,
        rival_var=track.rival_var + dt * RIVAL_DRIFT,
    )


def _tracked(
    track: Track, estimate: Estimate, dt: Seconds, ratio: float, share: float, settings: TrackSettings
) -> Track:
    """Return a predicted track after an estimate of a window that was touched for a share of its length.

    `ratio` is that of a window's length to the distance of windows.
    """
    variance = (max(estimate.std, MIN_STD) / share) ** 2
    error = estimate.value - track.place
    outside = error * error > settings.gate**2 * (track.place_var + variance)
    if share < 1.0 and (outside or variance < track.offset + track.place_var):
        # While a touch begins the newest window has most of it, and the first may have next to nothing.
        return _track_from(estimate.value, variance, track.time, dt, settings.offset)
    if outside:
        return _doubted(track, estimate.value, variance, dt, settings)
    total = track.place_var + (1.0 - settings.offset) * variance * ratio
    gain, gain_velocity = track.place_var / total, track.cross / total
    trust = min(track.trust + dt, settings.believe)
    is_sure = trust >= settings.believe
    return Track(
        place=track.place + gain * error,
        velocity=track.velocity + gain_velocity * error,
        place_var=(1.0 - gain) * track.place_var,
        cross=(1.0 - gain) * track.cross,
        velocity_var=track.velocity_var - gain_velocity * track.cross,
        offset=track.offset + gain * (settings.offset * variance - track.offset),
        time=track.time,
        seen=track.time,
        trust=trust,
        rival=math.nan if is_sure else track.rival,
        rival_var=math.nan if is_sure else track.rival_var,
    )


def _doubted(track: Track, place: Metres, variance: float, dt: Seconds, settings: TrackSettings) -> Track:
    """Return a track after an estimate outside its gate, which founds or supports a rival."""
    rival, rival_var, trust = place, variance, track.trust - dt
    error = place - track.rival
    if error * error <= settings.gate**2 * (track.rival_var + variance):
        gain = track.rival_var / (track.rival_var + variance)
        rival, rival_var = track.rival + gain * error, (1.0 - gain) * track.rival_var
    if trust < TIME_TOLERANCE:
        return _track_from(rival, variance, track.time, dt, settings.offset)
    return replace(track, trust=trust, rival=rival, rival_var=rival_var, seen=track.time)


TIME_TOLERANCE: Seconds = 1e-9
"""Sums of times that differ by less are the same."""


def _position_of(track: Track, unit: str, settings: TrackSettings) -> Estimate:
    variance = track.place_var + track.offset
    if not math.isnan(track.rival):
        variance += (1.0 - track.trust / settings.believe) * (track.rival - track.place) ** 2
    return Estimate(value=track.place, std=math.sqrt(variance), unit=unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class Press:
    """A force over time, after the window that ends at `time`.

    `force` in N, and the offsets of estimates at rest and while sliding, as shares of their standard
    deviations `resting_std` and `sliding_std` in N, NaN before any; with their covariance, the upper triangle
    of force, offset at rest, offset sliding. `seen` is the time of the last estimate.
    """

    force: float
    resting: float
    sliding: float
    covariance: tuple[float, float, float, float, float, float]
    time: Seconds
    seen: Seconds
    resting_std: float = math.nan
    sliding_std: float = math.nan


START_FORCE = 4.0
"""Variance of a force in N^2 before any estimate."""


def _press_from(estimate: Estimate, time: Seconds, settings: ForceSettings, *, slides: bool) -> Press:
    """Return the press that an estimate founds."""
    press = Press(
        force=estimate.value,
        resting=0.0,
        sliding=0.0,
        covariance=(START_FORCE, 0.0, 0.0, 1.0, settings.common, 1.0),
        time=time,
        seen=time,
    )
    return _pressed(press, estimate, 1.0, settings, slides=slides)


def _pressed(
    press: Press, estimate: Estimate, ratio: float, settings: ForceSettings, *, slides: bool
) -> Press:
    """Return a press after an estimate, which is force + standard deviation times offset + noise.

    The standard deviation of an offset stays what the first estimate at rest, or while sliding, says of it:
    one that followed every window's would let the offset be inferred from how they differ.
    """
    variance = max(estimate.std, MIN_STD) ** 2
    resting_std, sliding_std = press.resting_std, press.sliding_std
    if slides:
        if math.isnan(sliding_std):
            sliding_std = math.sqrt(settings.offset * variance)
        rest, slide = 0.0, sliding_std
    else:
        if math.isnan(resting_std):
            resting_std = math.sqrt(settings.offset * variance)
        rest, slide = resting_std, 0.0
    aa, ab, ac, bb, bc, cc = press.covariance
    a, b, c = aa + rest * ab + slide * ac, ab + rest * bb + slide * bc, ac + rest * bc + slide * cc
    noise = (1.0 - settings.offset) * variance * ratio
    total = a + rest * b + slide * c + noise
    error = (estimate.value - press.force - rest * press.resting - slide * press.sliding) / total
    return Press(
        force=press.force + a * error,
        resting=press.resting + b * error,
        sliding=press.sliding + c * error,
        covariance=(
            aa - a * a / total,
            ab - a * b / total,
            ac - a * c / total,
            bb - b * b / total,
            bc - b * c / total,
            cc - c * c / total,
        ),
        time=press.time,
        seen=press.time,
        resting_std=resting_std,
        sliding_std=sliding_std,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterState:
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


def _usable(given: Estimates) -> Estimates:
    """Return estimates with those that are no numbers as abstentions, whatever the estimator called them."""
    for each in given.values():
        if each.valid and not (math.isfinite(each.value) and math.isfinite(each.std)):
            break
    else:
        return given
    return {
        name: each
        if not each.valid or (math.isfinite(each.value) and math.isfinite(each.std))
        else Estimate.abstain(each.unit, NO_NUMBER)
        for name, each in given.items()
    }


NO_NUMBER = "not a number"
"""The reason where an estimator states no number."""
MIN_SHARE = 0.1
"""Least share of a window that is taken to be touched once a touch shows."""


def _contact(
    state: FilterState, given: Estimates, end: Seconds, settings: FilterSettings
) -> tuple[Switch, Seconds]:
    """Return the contact after a window that ends at a time, and the onset of the touch, NaN for none."""
    contact = given.get(CONTACT)
    if contact is None:  # an estimator without: there is a touch where there is a position
        position = given.get(POSITION)
        if position is not None and position.valid:
            return UNDECIDED, end if math.isnan(state.onset) else state.onset
        lost = state.position is None or end - state.position.seen > settings.position.coast
        return UNDECIDED, math.nan if lost else state.onset
    after = state.contact
    if contact.valid:
        if after.on is not None and end - after.time > settings.contact.hold:
            after = replace(after, level=0.0, turned=math.nan, led=math.nan, time=end)
        after = switch(after, contact.value, end, settings.contact)
    elif end - after.time > settings.contact.hold:
        return after, math.nan
    return after, after.since if after.on else after.turned


def _slip(
    before: Switch, given: Estimates, end: Seconds, onset: Seconds, share: float, settings: FilterSettings
) -> Switch:
    """Return the slip after a window; a touch begins at rest, until most of a window says otherwise."""
    slip = given.get(SLIP)
    if slip is None or math.isnan(onset):
        return UNDECIDED
    if before.on is None:
        off = settings.slip.off
        return Switch(on=False, since=onset, decided=end, level=math.log(off / (1.0 - off)), time=end)
    if not slip.valid:
        return before
    if share < SLIP_SHARE:
        return replace(before, time=end)  # what does not count does not average either
    return switch(before, slip.value, end, settings.slip)


SLIP_SHARE = 0.7
"""Share of a window that must be touched for its slip to count: the beginning of a touch sounds alike."""


def _next_track(
    before: Track | None,
    given: Estimates,
    end: Seconds,
    dt: Seconds,
    length: Seconds,
    share: float,
    slip: Switch,
    settings: FilterSettings,
) -> Track | None:
    options, position = settings.position, given.get(POSITION)
    if position is None:
        return None
    if before is not None and end - before.seen > options.coast:
        before = None
    if before is None:
        variance = (max(position.std, MIN_STD) / share) ** 2
        return _track_from(position.value, variance, end, dt, options.offset) if position.valid else None
    known = SLIP in given and given[SLIP].valid  # what the window does not say may be anything
    free = min(slip.probability / settings.slip.on, 1.0) if known else 1.0
    after = _predicted(before, end, free, options)
    return _tracked(after, position, dt, max(length / dt, 1.0), share, options) if position.valid else after


def _next_press(
    before: Press | None,
    given: Estimates,
    end: Seconds,
    dt: Seconds,
    length: Seconds,
    share: float,
    settings: FilterSettings,
    *,
    slides: bool,
) -> Press | None:
    options, force = settings.force, given.get(FORCE)
    if force is None:
        return None
    if before is not None and end - before.seen > options.coast:
        before = None
    if before is None or (share < 1.0 and force.valid):  # while it begins, the newest window is the best
        return _press_from(force, end, options, slides=slides) if force.valid else None
    aa, ab, ac, bb, bc, cc = before.covariance
    after = Press(
        force=before.force,
        resting=before.resting,
        sliding=before.sliding,
        covariance=(aa + options.change * dt, ab, ac, bb, bc, cc),
        time=end,
        seen=before.seen,
        resting_std=before.resting_std,
        sliding_std=before.sliding_std,
    )
    return _pressed(after, force, max(length / dt, 1.0), options, slides=slides) if force.valid else after


def _said(state: FilterState, given: Estimates, settings: FilterSettings) -> Tracked:
    """Return the estimates of a state, for a window of these estimates."""
    estimates, decided = dict[str, Estimate](), dict[str, bool]()
    contact, slip, track, press = state.contact, state.slip, state.position, state.force
    raw, touched = given.get(CONTACT), not math.isnan(state.onset)
    if raw is not None:
        touched = touched and contact.on is True
        if contact.on is None or state.time - contact.time > settings.contact.hold:
            estimates[CONTACT] = _missing(raw, touched=touched)
        else:
            decided[CONTACT] = contact.on
            estimates[CONTACT] = _probability(contact, raw.unit)
    raw = given.get(SLIP)
    if raw is not None:
        if touched and slip.on is not None and state.time - slip.time <= settings.slip.hold:
            decided[SLIP] = slip.on
            estimates[SLIP] = _probability(slip, raw.unit)
        else:
            estimates[SLIP] = _missing(raw, touched=touched)
            if decided.get(CONTACT) is False:
                decided[SLIP] = False
    raw = given.get(POSITION)
    if raw is not None:
        known = touched and track is not None and state.time - track.seen <= settings.position.coast
        estimates[POSITION] = (
            _position_of(track, raw.unit, settings.position)
            if known and track is not None
            else _missing(raw, touched=touched)
        )
    raw = given.get(FORCE)
    if raw is not None:
        known = touched and press is not None and state.time - press.seen <= settings.force.coast
        estimates[FORCE] = (
            Estimate(value=press.force, std=math.sqrt(press.covariance[0]), unit=raw.unit)
            if known and press is not None
            else _missing(raw, touched=touched)
        )
    return Tracked(estimates=estimates, decided=decided)


def _missing(raw: Estimate, *, touched: bool) -> Estimate:
    """Return the abstention of a window, or one of the filter's own where the window does not abstain."""
    return raw if not raw.valid else Estimate.abstain(raw.unit, LOST if touched else UNTOUCHED)


UNTOUCHED = "no contact"


def _probability(switch: Switch, unit: str) -> Estimate:
    value = switch.probability
    return Estimate(value=value, std=math.sqrt(value * (1.0 - value)), unit=unit)


def step(
    state: FilterState, prediction: Prediction, length: Seconds, settings: FilterSettings
) -> tuple[FilterState, Tracked]:
    """Return the state after a window, and what is known of the touch then.

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
    dt = length if math.isnan(state.time) else end - state.time
    contact, onset = _contact(state, given, end, settings)
    touching = not math.isnan(onset)
    anew = touching and onset != state.onset
    share = min(max((end - onset + dt) / length, MIN_SHARE), 1.0) if touching else 1.0
    slip = _slip(UNDECIDED if anew or not touching else state.slip, given, end, onset, share, settings)
    track = press = None
    if touching:
        track = _next_track(None if anew else state.position, given, end, dt, length, share, slip, settings)
        press = _next_press(
            None if anew else state.force, given, end, dt, length, share, settings, slides=slip.on is True
        )
    state = FilterState(
        start=prediction.start,
        time=end,
        onset=onset,
        contact=contact,
        slip=slip,
        position=track,
        force=press,
    )
    return state, _said(state, given, settings)
