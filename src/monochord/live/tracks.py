"""Position and force of a touch over time, each with its standard error.

- **A touch moves continuously.** Position is a Kalman filter with a nearly constant velocity (Bar-Shalom, Li
  and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, ch. 6) that changes freely
  while the touch slides and hardly at rest. During an abstention, the prediction's uncertainty grows.
- **The driven string may lock to another mode, and an estimate then jumps.** An estimate outside the gate
  does not move the track. It starts a rival, which later estimates support or oppose; the track switches to
  it after lasting support. Until then, the standard error covers both.
- **Most of an error stays as long as the touch.** A share of an estimate's stated variance is an offset of
  this object on this sensor, which averaging cannot remove; the rest fluctuates. Windows of length T that
  begin dt apart overlap: averaging them equals averaging independent ones with the variance times T / dt
  (the integral of their triangular autocorrelation), and the filter assumes that noise. For force, the
  offsets at rest and while sliding are two unknowns of one force. So information gained at rest still counts
  when the object slides, where a single estimate may be far off.
"""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from msgspec import Meta

from monochord.core.ranges import Checked, NonNegative, PartialShare
from monochord.core.types import OUTSIDE_RANGE, Estimate
from monochord.core.units import Metres, Seconds
from monochord.live.switches import TIME_TOLERANCE

MIN_STD = 1e-6
"""Smallest standard error of an estimate, in its unit, so that rounding leaves every variance positive."""
START_VELOCITY = 0.01
"""Initial standard deviation of the velocity, in m/s."""
STOP: Seconds = 0.03
"""Time in which the velocity of a resting touch decays to 1/e, in s."""
RIVAL_DRIFT = 1e-5
"""Growth of a rival's position variance per second, in m^2."""
START_FORCE = 4.0
"""Initial variance of a force, in N^2."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackSettings(Checked):
    """Settings of the position tracker.

    Parameters
    ----------
    offset
        Share of an estimate's variance that is constant over a touch, 0 to 1.
    sliding, resting
        Spectral density of the acceleration while sliding and at rest, in m^2 / s^3.
    gate
        Standard errors beyond which an estimate supports a rival instead of the track.
    believe
        Net time for which estimates must contradict an established track before it jumps, in s.
    coast
        How long an established track is predicted without estimates, in s; proportionally less for a track
        supported for less than `believe`.
    """

    offset: PartialShare = 0.9
    sliding: Annotated[float, Meta(gt=0.0)] = 5e-3
    resting: Annotated[float, Meta(gt=0.0)] = 5e-3
    gate: Annotated[float, Meta(gt=0.0)] = 5.0
    believe: NonNegative[Seconds] = 0.15
    coast: NonNegative[Seconds] = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSettings(Checked):
    """Settings of the force tracker.

    Parameters
    ----------
    offset
        Share of an estimate's variance that is constant over a touch, 0 to 1.
    common
        Correlation between the offsets at rest and while sliding, 0 to 1.
    change
        Growth of the force's variance per second, in N^2 / s.
    coast
        How long the force is predicted without estimates, in s.
    """

    offset: PartialShare = 0.9
    common: PartialShare = 0.8
    change: Annotated[float, Meta(gt=0.0)] = 1.0
    coast: NonNegative[Seconds] = 0.3


class Span(NamedTuple):
    """A window's place in time.

    `end` is its end in s, `dt` the time since the previous window's end, `ratio` its length in units of dt, 1
    or more, and `share` the share of it in contact.
    """

    end: Seconds
    dt: Seconds
    ratio: float
    share: float


class Track(NamedTuple):
    """A position over time.

    `place` in m and `velocity` in m/s have the covariance `place_var`, `cross`, `velocity_var`. `offset` is
    the variance that is constant over the touch. `last_estimate` is the end of the last window with an
    estimate. `trust` is the net time in s for which estimates have supported the track; estimates outside its
    gate support a rival at `rival` of variance `rival_var`, NaN for none.
    """

    place: Metres
    velocity: float
    place_var: float
    cross: float
    velocity_var: float
    offset: float
    last_estimate: Seconds
    trust: Seconds
    rival: Metres = math.nan
    rival_var: float = math.nan

    def estimate(self, unit: str, settings: TrackSettings) -> Estimate:
        """Return the position, with an uncertainty that covers a rival."""
        variance = self.place_var + self.offset
        if not math.isnan(self.rival):
            variance += (1.0 - self.trust / settings.believe) * (self.rival - self.place) ** 2
        return Estimate(value=self.place, std=math.sqrt(variance), unit=unit)


def track_after(
    before: Track | None, position: Estimate, span: Span, sliding: float, settings: TrackSettings
) -> Track | None:
    """Return the track after a window, None for none; `slip` is the probability that the touch slides.

    A touch that leaves the sensing range ends the track: its past estimates do not hold outside.
    """
    if before is not None:
        # What few estimates have supported is not carried on for long.
        coast = settings.coast * (before.trust / settings.believe if settings.believe else 1.0)
        is_over = position.reason == OUTSIDE_RANGE or span.end - before.last_estimate > coast + TIME_TOLERANCE
        before = None if is_over else before
    variance = (max(position.std, MIN_STD) / span.share) ** 2
    if before is None:
        return _track_from(position.value, variance, span, settings) if position.valid else None
    track = _predicted(before, span.dt, sliding, settings)
    if not position.valid:
        return track
    error = position.value - track.place
    outside = error * error > settings.gate**2 * (track.place_var + variance)
    if span.share < 1.0 and (outside or variance < track.offset + track.place_var):
        # While a touch begins the newest window has most of it, and the first may have next to nothing.
        return _track_from(position.value, variance, span, settings)
    if outside:
        return _outside_gate(track, position.value, variance, span, settings)
    return _updated(track, error, variance, span, settings)


def _track_from(place: Metres, variance: float, span: Span, settings: TrackSettings) -> Track:
    """Return the track that starts from an estimate, with a share of its variance as the offset."""
    return Track(
        place=place,
        velocity=0.0,
        place_var=(1.0 - settings.offset) * variance,
        cross=0.0,
        velocity_var=START_VELOCITY**2,
        offset=settings.offset * variance,
        last_estimate=span.end,
        trust=min(span.dt, settings.believe),
    )


def _predicted(track: Track, dt: Seconds, sliding: float, settings: TrackSettings) -> Track:
    """Return a track predicted to a later time."""
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
        last_estimate=track.last_estimate,
        trust=track.trust,
        rival=track.rival,
        rival_var=track.rival_var + dt * RIVAL_DRIFT,
    )


def _updated(track: Track, error: Metres, variance: float, span: Span, settings: TrackSettings) -> Track:
    """Return a predicted track after an estimate inside its gate."""
    total = track.place_var + (1.0 - settings.offset) * variance * span.ratio
    gain, gain_velocity = track.place_var / total, track.cross / total
    trust = min(track.trust + span.dt, settings.believe)
    is_sure = trust >= settings.believe
    return Track(
        place=track.place + gain * error,
        velocity=track.velocity + gain_velocity * error,
        place_var=(1.0 - gain) * track.place_var,
        cross=(1.0 - gain) * track.cross,
        velocity_var=track.velocity_var - gain_velocity * track.cross,
        offset=track.offset + gain * (settings.offset * variance - track.offset),
        last_estimate=span.end,
        trust=trust,
        rival=math.nan if is_sure else track.rival,
        rival_var=math.nan if is_sure else track.rival_var,
    )


def _outside_gate(track: Track, place: Metres, variance: float, span: Span, settings: TrackSettings) -> Track:
    """Return a predicted track after an estimate outside its gate, which starts or supports a rival."""
    rival, rival_var, trust = place, variance, track.trust - span.dt
    error = place - track.rival
    if error * error <= settings.gate**2 * (track.rival_var + variance):
        gain = track.rival_var / (track.rival_var + variance)
        rival, rival_var = track.rival + gain * error, (1.0 - gain) * track.rival_var
    if trust < TIME_TOLERANCE:
        return _track_from(rival, variance, span, settings)
    return track._replace(trust=trust, rival=rival, rival_var=rival_var, last_estimate=span.end)


class ForceTrack(NamedTuple):
    """A force over time.

    `force` is in N. `resting` and `sliding` are the offsets of estimates at rest and while sliding, in units
    of their standard deviations `resting_std` and `sliding_std` in N, NaN before any estimate. `covariance`
    is the upper triangle of the covariance of force, resting and sliding. `last_estimate` is the end of the
    last window with an estimate.
    """

    force: float
    resting: float
    sliding: float
    covariance: tuple[float, float, float, float, float, float]
    last_estimate: Seconds
    resting_std: float = math.nan
    sliding_std: float = math.nan

    def estimate(self, unit: str) -> Estimate:
        """Return the force."""
        return Estimate(value=self.force, std=math.sqrt(self.covariance[0]), unit=unit)


def force_track_after(
    before: ForceTrack | None, force: Estimate, span: Span, settings: ForceSettings, *, slides: bool
) -> ForceTrack | None:
    """Return the force track after a window, None for none or outside the sensing range."""
    if force.reason == OUTSIDE_RANGE or (
        before is not None and span.end - before.last_estimate > settings.coast
    ):
        before = None
    ratio = span.ratio
    if force.valid and (before is None or span.share < 1.0):  # while it begins, the newest window is the best
        covariance = (START_FORCE, 0.0, 0.0, 1.0, settings.common, 1.0)
        track, ratio = ForceTrack(force.value, 0.0, 0.0, covariance, span.end), 1.0
    elif before is None:
        return None
    else:
        aa, ab, ac, bb, bc, cc = before.covariance
        track = before._replace(covariance=(aa + settings.change * span.dt, ab, ac, bb, bc, cc))
    return _updated_force(track, force, span.end, ratio, settings, slides=slides) if force.valid else track


def _updated_force(
    track: ForceTrack,
    estimate: Estimate,
    end: Seconds,
    ratio: float,
    settings: ForceSettings,
    *,
    slides: bool,
) -> ForceTrack:
    """Return a force track after an estimate, modelled as force + standard deviation times offset + noise.

    The first estimate at rest, or while sliding, sets the offset's standard deviation for good: a value that
    followed every window would let the filter infer the offset from the differences.
    """
    variance = max(estimate.std, MIN_STD) ** 2
    resting_std, sliding_std = track.resting_std, track.sliding_std
    if slides:
        if math.isnan(sliding_std):
            sliding_std = math.sqrt(settings.offset * variance)
        rest, slide = 0.0, sliding_std
    else:
        if math.isnan(resting_std):
            resting_std = math.sqrt(settings.offset * variance)
        rest, slide = resting_std, 0.0
    aa, ab, ac, bb, bc, cc = track.covariance
    a, b, c = aa + rest * ab + slide * ac, ab + rest * bb + slide * bc, ac + rest * bc + slide * cc
    noise = (1.0 - settings.offset) * variance * ratio
    total = a + rest * b + slide * c + noise
    error = (estimate.value - track.force - rest * track.resting - slide * track.sliding) / total
    return ForceTrack(
        force=track.force + a * error,
        resting=track.resting + b * error,
        sliding=track.sliding + c * error,
        covariance=(
            aa - a * a / total,
            ab - a * b / total,
            ac - a * c / total,
            bb - b * b / total,
            bc - b * c / total,
            cc - c * c / total,
        ),
        last_estimate=end,
        resting_std=resting_std,
        sliding_std=sliding_std,
    )
