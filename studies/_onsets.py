"""The effect of estimates over time: detection delays of touch and slip, and error sizes.

The estimates of a source's windows are recorded once, with the truth; the filter of `monochord.live` is then
applied to them with any settings. The baseline judges the same windows one by one.
"""

import dataclasses
import math
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from monochord.capture.sources.base import Source, Stream
from monochord.core.errors import InputError
from monochord.core.types import Audio, Block, Floats, Prediction, Signal, StreamHealth, Truth
from monochord.core.units import Samples, Seconds
from monochord.live import FilterSettings, FilterState, LiveRun, LiveStream, SwitchSettings, Tracked, step
from monochord.metrics import detection_delays, false_alarms, stretches

PARTS = 5
"""Steps per hop at which the truth is sampled, so that onsets are known to 2 ms."""
PAUSE: Seconds = 0.2
"""A shorter pause in a slide, in s (two windows), belongs to the slide."""
SHORTEST: Seconds = 0.1
"""Shortest touch or slide that counts as an event, in s: a window long."""
EARLY: Seconds = 0.02
"""How long before its event an alarm may begin, in s: the accuracy of the truth."""
CLEARANCE = 0.75
"""Threshold for switching off, relative to that for switching on."""
OUTLIER_STD = 5.0
"""Standard errors beyond which an estimate is confidently wrong."""
TIME_TOLERANCE: Seconds = 1e-6
"""Times closer than this are equal, in s."""
MIN_SPEED = 5.0e-3
"""Smallest speed along the string, in m/s, of a touch that moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WithNoise(Source):
    """Another source with noise added to all channels: `sound` (n,), repeated without end, times `gain`."""

    source: Source
    sound: Audio
    gain: float = 1.0

    @contextmanager
    def open(self) -> Generator[Stream]:
        """Open the other source; raises as it does, and `InputError` for an empty sound."""
        if not len(self.sound):
            raise InputError("noise of 0 frames", "1 frame or more")
        with self.source.open() as stream:
            yield _NoisyStream(stream, (self.gain * self.sound).astype(np.float32))


class _NoisyStream(Stream):
    def __init__(self, stream: Stream, sound: Audio) -> None:
        self._stream, self._sound = stream, sound

    @property
    def signal(self) -> Signal:
        return self._stream.signal

    @property
    def health(self) -> StreamHealth:
        return self._stream.health

    def truth(self, start: Samples, stop: Samples) -> Truth:
        return self._stream.truth(start, stop)

    def close(self) -> None:
        self._stream.close()

    def __iter__(self) -> Iterator[Block]:
        for block in self._stream:
            at = (block.start + np.arange(block.samples.shape[1])) % len(self._sound)
            yield dataclasses.replace(block, samples=block.samples + self._sound[at])


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """The predictions of a source's windows, with the truth.

    `window` and `hop` are in s. `truth` is that of each window, by the label rules; `touched` and `slides`
    (m,) are the truth in the steps of time that end at `time` (m,), in s since the stream began.
    """

    predictions: tuple[Prediction, ...]
    truth: tuple[Truth, ...]
    window: Seconds
    hop: Seconds
    time: Floats
    touched: NDArray[np.bool_]
    slides: NDArray[np.bool_]

    @property
    def end(self) -> Floats:
        """Ends of the windows (n,) in s since the stream began."""
        return np.array([each.time for each in self.predictions]) + self.window

    @property
    def minutes(self) -> float:
        """Time with known truth, in minutes."""
        return float(self.known.sum()) * self.hop / 60.0

    @property
    def known(self) -> NDArray[np.bool_]:
        """Whether the truth of each window (n,), and of overlapping windows, is known.

        It is unknown during a session's alignment taps, which sound like touches.
        """
        unknown = np.array([not each for each in self.truth], np.float64)
        near = np.convolve(unknown, np.ones(2 * math.ceil(self.window / self.hop) + 1), mode="same")
        return near < 0.5


def record(setup: LiveRun) -> Recorded:
    """Return the predictions of a run's windows with the truth, without its sinks.

    Raises
    ------
    InputError
        If a part of the run rejects its options or the signal, or there is no truth.
    """
    predictions, truths, times, parts = list[Prediction](), list[Truth](), list[float](), list[Truth]()
    with setup.source.open() as stream:
        live = LiveStream(setup, stream)
        size, hop = setup.window.frames(live.signal.sample_rate)
        rate = live.signal.sample_rate
        edges = np.linspace(-hop, 0, PARTS + 1).round().astype(int).tolist()
        for update in live:
            predictions.append(update.prediction)
            truths.append(update.truth)
            end = update.prediction.start + size
            for first, last in pairwise(edges):
                times.append((end + last) / rate)
                parts.append(stream.truth(end + first, end + last))
    touched = np.array([each.get("contact", 0.0) >= 0.5 for each in parts], bool)
    if not any(parts):
        raise InputError("a source that knows nothing to be true", "the twin, or a session with labels")
    return Recorded(
        predictions=tuple(predictions),
        truth=tuple(truths),
        window=size / rate,
        hop=hop / rate,
        time=np.array(times),
        touched=touched,
        slides=touched & np.array([each.get("slip", 0.0) >= 0.5 for each in parts], bool),
    )


def followed(take: Recorded, settings: FilterSettings) -> list[Tracked]:
    """Return the filter's output after each window."""
    state, result = FilterState(), list[Tracked]()
    for prediction in take.predictions:
        state, tracked = step(state, prediction, take.window, settings)
        result.append(tracked)
    return result


@dataclass(frozen=True, slots=True, kw_only=True)
class Onsets:
    """Onset detection at one threshold.

    `median` and `p95` are the delays in s from the true onset to the end of the deciding window, over the
    detected `events`, NaN for none; `missed` is the share of undetected events, and `false_alarms` the number
    per minute.
    """

    threshold: float
    median: Seconds
    p95: Seconds
    missed: float
    false_alarms: float
    events: int


def onsets(takes: Sequence[Recorded], name: str, threshold: float, settings: FilterSettings | None) -> Onsets:
    """Return the detection delay and false alarms of ``contact`` or ``slip``.

    Parameters
    ----------
    takes
        One or more.
    name
        ``contact`` or ``slip``.
    threshold
        Probability for switching on. With a filter, it switches off below three quarters of that.
    settings
        Settings of the filter; None judges each window separately.
    """
    delays, alarms, minutes = list[float](), 0, 0.0
    for take in takes:
        on = _decided(take, name, threshold, settings)
        begun = stretches(take.end, on, take.hop) if on.any() else np.zeros((0, 2))
        begun = begun[take.known[np.searchsorted(take.end, begun[:, 0] - TIME_TOLERANCE)]]
        events = _events(take, name)
        delays += detection_delays(events, begun, EARLY).tolist()
        alarms += false_alarms(_with_tails(events, take.window), begun, EARLY)
        minutes += take.minutes
    seen = np.array([each for each in delays if not math.isnan(each)])
    return Onsets(
        threshold=threshold,
        median=float(np.median(seen)) if len(seen) else math.nan,
        p95=float(np.quantile(seen, 0.95)) if len(seen) else math.nan,
        missed=1.0 - len(seen) / len(delays) if delays else 0.0,
        false_alarms=alarms / minutes,
        events=len(delays),
    )


def _decided(
    take: Recorded, name: str, threshold: float, settings: FilterSettings | None
) -> NDArray[np.bool_]:
    """Return whether the decision is on in each window (n,)."""
    if settings is None:
        values = (each.estimate(name) for each in take.predictions)
        return np.array([each.valid and each.value >= threshold for each in values], bool)
    own: SwitchSettings = getattr(settings, name)
    changed = dataclasses.replace(own, on=threshold, off=CLEARANCE * threshold)
    said = followed(take, dataclasses.replace(settings, **{name: changed}))
    return np.array([each.decided.get(name, False) for each in said], bool)


def _events(take: Recorded, name: str) -> Floats:
    """Return begin and end (k, 2) of the true events, with short pauses bridged and short events left out."""
    on = take.touched if name == "contact" else take.slides
    if not on.any():
        return np.zeros((0, 2))
    events = list[list[float]]()
    for begin, end in stretches(take.time, on, take.hop / PARTS).tolist():
        if events and begin - events[-1][1] < (PAUSE if name == "slip" else SHORTEST):
            events[-1][1] = end
        else:
            events.append([begin, end])
    return np.array([each for each in events if each[1] - each[0] >= SHORTEST]).reshape(-1, 2)


def _with_tails(events: Floats, window: Seconds) -> Floats:
    """Return events (k, 2) that each go on for a window, which still holds some of it, or to the next."""
    if not len(events):
        return events
    following = np.append(events[1:, 0], np.inf)
    return np.column_stack([events[:, 0], np.minimum(events[:, 1] + window, following)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Errors of a quantity in touched windows, against its mean over the window's touched time.

    `raw` and `tracked` are mean absolute errors where both have an estimate, in the quantity's unit; those of
    touches held and moving along the string are separate, too. `raw_answered` and `tracked_answered` are the
    shares of the touched `windows` with an estimate. `within_1` and `within_2` are the shares of tracked
    estimates within one and two of their standard errors, `raw_far` and `tracked_far` the shares off by more
    than five.
    """

    raw: float
    tracked: float
    raw_held: float
    tracked_held: float
    raw_moving: float
    tracked_moving: float
    raw_answered: float
    tracked_answered: float
    within_1: float
    within_2: float
    raw_far: float
    tracked_far: float
    windows: int


def errors(takes: Sequence[Recorded], name: str, settings: FilterSettings) -> Errors:
    """Return the errors of ``position`` or ``force`` with and without the filter.

    Raises
    ------
    InputError
        If no take contains a touch.
    """
    parts = [_errors(take, name, settings) for take in takes]
    raw, raw_std, own, std, speed = (np.concatenate(each) for each in zip(*parts, strict=True))
    if not len(raw):
        raise InputError("takes in which nothing touches", "one touch or more")
    answered, raw_answered = np.isfinite(own), np.isfinite(raw)
    both, moving = answered & raw_answered, np.abs(speed) >= MIN_SPEED
    size, raw_size = np.abs(own[answered]) / std[answered], np.abs(raw[raw_answered]) / raw_std[raw_answered]
    return Errors(
        raw=_mean(np.abs(raw[both])),
        tracked=_mean(np.abs(own[both])),
        raw_held=_mean(np.abs(raw[both & ~moving])),
        tracked_held=_mean(np.abs(own[both & ~moving])),
        raw_moving=_mean(np.abs(raw[both & moving])),
        tracked_moving=_mean(np.abs(own[both & moving])),
        raw_answered=_mean(raw_answered),
        tracked_answered=_mean(answered),
        within_1=_mean(size < 1.0),
        within_2=_mean(size < 2.0),
        raw_far=_mean(raw_size > OUTLIER_STD),
        tracked_far=_mean(size > OUTLIER_STD),
        windows=len(raw),
    )


def _mean(values: Floats | NDArray[np.bool_]) -> float:
    return float(values.mean()) if len(values) else math.nan


def _errors(take: Recorded, name: str, settings: FilterSettings) -> tuple[Floats, ...]:
    """Return errors and standard errors, of windows and as tracked, and the touch's speed, (n,) each."""
    truth, place = (
        np.array([each.get(what, math.nan) for each in take.truth]) for what in (name, "position")
    )
    raw = np.array([(e.value, e.std) for e in (each.estimate(name) for each in take.predictions)])
    own = np.array([(e.value, e.std) for e in (each.estimates[name] for each in followed(take, settings))])
    speed = np.gradient(place, take.hop) if len(place) > 1 else np.full(len(place), math.nan)
    rows = np.isfinite(truth)
    columns = (raw[:, 0] - truth, raw[:, 1], own[:, 0] - truth, own[:, 1], speed)
    return tuple(each[rows] for each in columns)
