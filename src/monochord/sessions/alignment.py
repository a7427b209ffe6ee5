"""Check whether a session's streams share a clock, and put them on one."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.sessions.reader import SessionReader
from monochord.sessions.sync.arrival import ReadingTimes, times_taken
from monochord.sessions.sync.pulses import Taps, groups_of, taps_of_force, taps_of_height
from monochord.sessions.sync.taps import (
    HOW_TO_TAP,
    MIN_TAPS,
    Offset,
    audio_offset,
    height_offset,
    travel_time,
)
from monochord.sessions.tracks import AUDIO, ReadingTrack

BEYOND: Seconds = 0.5
"""Search this much further than the allowed offset, so that a larger one can be reported."""
SPARE: Seconds = 0.2
"""Margin around a group of taps, in s."""
AROUND_TAPS: Seconds = 1.5
"""Sound this close to the middle of a tap group has no labels where no event times the drivers, in s."""
Spans: TypeAlias = tuple[tuple[Seconds, Seconds], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits beyond which a session is flagged.

    `drift` of audio against force from the first to the last taps, and the standard error `std` of that
    offset, in s; both for a pose stream in sampling `intervals`. Largest absolute `offset` of any stream,
    `step` of the wall clock between two readings, and `stray` of the converter's times from its frame count,
    in s. `taps` is the smallest number detected at each end of a stream.
    """

    drift: Seconds = 1e-3
    std: Seconds = 0.5e-3
    intervals: float = 1.0
    offset: Seconds = 1.0
    taps: int = MIN_TAPS
    step: Seconds = 0.05
    stray: Seconds = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Lateness:
    """Delay of a stream at a session's beginning and end.

    `times` are the session seconds of the two tap groups. With taps at one end only, both delays are equal;
    without taps, both are NaN.
    """

    times: tuple[Seconds, Seconds]
    offsets: tuple[Offset, Offset]

    @property
    def drift(self) -> Seconds:
        """Increase of the delay from start to end, in s; NaN where unknown."""
        if not (self.times[1] > self.times[0] and all(offset.is_determined for offset in self.offsets)):
            return math.nan
        return self.offsets[1].value - self.offsets[0].value

    @property
    def ppm(self) -> float:
        """The drift relative to the time between the taps, in ppm; NaN where unknown."""
        span = self.times[1] - self.times[0]
        return 1e6 * self.drift / span if span > 0.0 else math.nan

    def at(self, time: Floats) -> Floats:
        """Return the delay at the stream's own times: linear between both ends, 0 where unknown."""
        known = [offset.is_determined for offset in self.offsets]
        if not any(known):
            return np.zeros_like(time)
        if not all(known) or not self.times[1] > self.times[0]:
            return np.full_like(time, self.offsets[known.index(True)].value)
        first, last = (offset.value for offset in self.offsets)
        begin, end = self.times[0] + first, self.times[1] + last
        return first + (time - begin) * ((last - first) / (end - begin))


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """The offsets between a session's streams.

    `reference` is the stream whose clock is taken as true. `lateness` holds the delay of every other stream.
    `flags` has one sentence for each problem; an empty tuple means that the session can be relied on. `taps`
    holds the contact onsets (n,) of each tap group used, on the reference's clock.
    """

    reference: str
    lateness: Mapping[str, Lateness]
    flags: tuple[str, ...] = ()
    taps: tuple[Floats, ...] = ()

    def correct(self, stream: str, time: Floats) -> Floats:
        """Return a stream's times on the reference's clock; a stream without taps stays unchanged.

        >>> alignment = Alignment(reference="wrench", lateness={})
        >>> alignment.correct("audio", np.array([1.0])).tolist()
        [1.0]
        """
        late = self.lateness.get(stream)
        return time if late is None else time - late.at(time)


def align(session: SessionReader, limits: Limits | None = None) -> Alignment:
    """Estimate the offsets between a session's streams from the taps at its beginning and end.

    The reference is the force where there is one, else the microphones; then the pose locates the taps. Every
    other stream's offset is measured at the first and the last group of taps (see `sessions.sync.taps` for
    the method and the sign: positive is late) and interpolated linearly between them. This reads the
    session's audio. Without taps the alignment leaves all times unchanged and has a flag; without flags, the
    session can be relied on.
    """
    limits = limits or Limits()
    force, poses = _seen(session, "fz", "wrench"), _seen(session, "z", "pose")
    guide, others = (force[0], poses) if force else (poses[0] if poses else None, [])
    reference = force[0].stream if force else AUDIO
    flags = _mute(session, (seen.stream for seen in (*force, *poses)))
    flags += [*_steps_of_the_wall_clock(session, limits), *_strays(session, limits)]
    groups = () if guide is None else groups_of((taps_of_force if force else taps_of_height)(*guide.rows))
    if not groups:
        if guide is not None:
            unknown = f"there are no taps in {guide.stream}: the offset between the streams is unknown"
            flags.append(f"{unknown}; {HOW_TO_TAP}")
        return Alignment(reference=reference, lateness={}, flags=tuple(flags))
    if len(groups) == 1:
        flags.append(f"there are taps at {groups[0].begin[0]:.1f} s only: the drift is unknown; {HOW_TO_TAP}")
    ends = groups[0], groups[-1]
    times = float(ends[0].middle.mean()), float(ends[1].middle.mean())
    sound = _of_audio(session, ends[0], limits), _of_audio(session, ends[1], limits)
    lateness: dict[str, Lateness] = {}
    if force or guide is None:
        lateness[AUDIO] = Lateness(times=times, offsets=sound)
    else:
        lateness[guide.stream] = Lateness(times=times, offsets=(_turned(sound[0]), _turned(sound[1])))
        late = lateness[guide.stream]
        groups = tuple(replace(group, begin=group.begin - late.at(group.begin)) for group in groups)
    for seen in others:
        both = _of_height(seen, ends[0], limits), _of_height(seen, ends[1], limits)
        lateness[seen.stream] = Lateness(times=times, offsets=both)
    spacing = {seen.stream: float(np.median(np.diff(seen.rows[0]))) for seen in poses}
    for name, late in lateness.items():
        flags += _flags_of(name, late, spacing.get(name, 0.0), limits)
    used = (groups[0].begin, groups[-1].begin)[: len(groups)]
    return Alignment(reference=reference, lateness=lateness, flags=tuple(flags), taps=used)


def reading_times(track: ReadingTrack) -> ReadingTimes:
    """Return when readings were taken, in session seconds, from the sender's clock or sequence number.

    See `sessions.sync.arrival.times_taken`. A sender with neither gets the times of arrival.
    """
    feed = track.feed
    if feed.ticks > 0.0 and (track.device_time >= 0).all():
        return times_taken(track.time, track.device_time, rate=feed.ticks)
    if feed.rate > 0.0 and (track.sequence >= 0).all():
        return times_taken(track.time, track.sequence, rate=feed.rate)
    return times_taken(track.time, None)


def aligned_readings(session: SessionReader, stream: str, alignment: Alignment) -> ReadingTrack:
    """Return a stream's readings in order of the time they were taken, on the reference's clock."""
    track = session.readings(stream)
    time = alignment.correct(stream, reading_times(track).time)
    order = np.argsort(time, kind="stable")
    return replace(
        track,
        time=time[order],
        values=track.values[order],
        sequence=track.sequence[order],
        device_time=track.device_time[order],
        status=track.status[order],
    )


def calibration_spans(session: SessionReader, alignment: Alignment) -> Spans:
    """Return the spans (begin, end) in s in which the drivers are off for the taps.

    The session's events of kind "drivers" give the spans. Without such events, a span runs from the session's
    edge to `AROUND_TAPS` on the inner side of the first and last tap group. Sound in these spans has no
    labels. Begin and end may be infinite.
    """
    switched = [(event.time, event.text == "on") for event in session.events if event.kind == "drivers"]
    if not switched:
        late = next(iter(alignment.lateness.values()), None)
        if late is None:
            return ()
        first, last = late.times
        head = (-math.inf, first + AROUND_TAPS)
        return (head, (last - AROUND_TAPS, math.inf)) if last > first else (head,)
    spans: list[tuple[Seconds, Seconds]] = []
    off_since = -math.inf if switched[0][1] else None
    for time, on in switched:
        if on and off_since is not None:
            spans.append((off_since, time))
        off_since = None if on else time if off_since is None else off_since
    return (*spans, (off_since, math.inf)) if off_since is not None else tuple(spans)


class _TapStream(NamedTuple):
    """A stream that detects taps: its times, rising, and the values in which taps show."""

    stream: str
    rows: tuple[Floats, Floats]


def _seen(session: SessionReader, column: str, usual: str) -> list[_TapStream]:
    """Return the streams that have the column and readings, the one with the default name first."""
    names = [feed.stream for feed in session.description.feeds if column in feed.columns]
    streams: list[_TapStream] = []
    for name in sorted(names, key=lambda name: name != usual):
        track = session.readings(name)
        time, values = reading_times(track).time, track.column(column)
        order = np.argsort(time)
        known = order[np.isfinite(values[order])]
        if known.size > 1:
            streams.append(_TapStream(name, (time[known], values[known])))
    return streams


def _of_audio(session: SessionReader, group: Taps, limits: Limits) -> Offset:
    track, string = session.audio, session.description.string
    reach = limits.offset + BEYOND
    low, high = group.begin[0] - reach - SPARE, group.end[-1] + reach + SPARE
    first, stop = (int(np.clip(track.frame(t), 0, track.samples.shape[1])) for t in (low, high))
    travel = 0.0
    if string is not None:
        travel = travel_time(string.length, math.sqrt(string.tension / string.linear_density))[0]
    return audio_offset(
        group,
        track.samples[:, first:stop],
        first=float(track.time(first)),
        rate=track.line[0],
        travel=travel,
        reach=reach,
    )


def _of_height(seen: _TapStream, group: Taps, limits: Limits) -> Offset:
    reach = limits.offset + BEYOND
    time, height = seen.rows
    edges = np.searchsorted(time, [group.begin[0] - reach - SPARE, group.end[-1] + reach + SPARE])
    around = slice(*edges.tolist())
    return height_offset(group, time[around], height[around], reach=reach)


def _turned(offset: Offset) -> Offset:
    """Return the reference's offset against the stream, from the stream's offset against the reference."""
    return replace(offset, value=-offset.value, each=-offset.each)


def _flags_of(stream: str, late: Lateness, spacing: Seconds, limits: Limits) -> list[str]:
    """Return one sentence for each problem of a stream."""
    flags: list[str] = []
    drift = limits.drift if stream == AUDIO else limits.intervals * spacing
    std = limits.std if stream == AUDIO else limits.intervals * spacing
    ends = 2 if late.times[1] > late.times[0] else 1
    for place, offset in zip(("start", "end")[:ends], late.offsets[:ends], strict=True):
        if not offset.is_determined:
            flags.append(f"{stream} shows no taps within {limits.offset:g} s at the {place}")
            continue
        if offset.taps < limits.taps:
            few = f"{stream} shows {offset.taps} taps at the {place}; {limits.taps} are needed"
            flags.append(f"{few}: {HOW_TO_TAP}")
        if offset.std > std:
            flags.append(
                f"{stream}'s offset at the {place} is uncertain by {1e3 * offset.std:.2f} ms;"
                f" expected {1e3 * std:.2f} ms"
            )
        if abs(offset.value) > limits.offset:
            flags.append(
                f"{stream} is {abs(offset.value):.2f} s {'late' if offset.value > 0.0 else 'early'} at the"
                f" {place}; expected {limits.offset:g} s"
            )
    if abs(late.drift) > drift:
        flags.append(
            f"{stream} drifts by {1e3 * late.drift:+.2f} ms ({late.ppm:+.0f} ppm) from the start to the end;"
            f" expected {1e3 * drift:.2f} ms"
        )
    return flags


def _mute(session: SessionReader, seen: Iterable[str]) -> list[str]:
    """Return a sentence for each force and pose stream without readings."""
    due = {feed.stream for feed in session.description.feeds if {"fz", "z"} & set(feed.columns)}
    return [f"{stream} has no readings" for stream in sorted(due - set(seen))]


def _steps_of_the_wall_clock(session: SessionReader, limits: Limits) -> list[str]:
    """Return a sentence for each step of the wall clock against the monotonic clock."""
    track = session.clocks
    offsets = track.offsets.get("realtime", np.zeros(0))
    steps = np.diff(offsets)
    return [
        f"the wall clock was set by {steps[k]:+.3f} s"
        f" between {track.time[k]:.1f} s and {track.time[k + 1]:.1f} s"
        for k in np.flatnonzero(np.abs(steps) > limits.step)
    ]


def _strays(session: SessionReader, limits: Limits) -> list[str]:
    """Return a sentence where a sound server lost frames without counting them."""
    stray = session.audio.unevenness
    if stray <= limits.stray:
        return []
    lost = (
        f"audio's times stray from its frames by {1e3 * stray:.1f} ms: the sound server lost some uncounted"
    )
    return [f"{lost}; expected {1e3 * limits.stray:g} ms"]
