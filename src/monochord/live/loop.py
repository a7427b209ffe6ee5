"""The loop from blocks to sinks, readable top to bottom."""

import dataclasses
import gc
import sys
import time
from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from monochord.capture.sources._resampled import at_rate
from monochord.capture.sources.base import Stream
from monochord.core.clock import SampleClock
from monochord.core.errors import InputError
from monochord.core.interruption import interruption
from monochord.core.priority import FIRST, before_other_programs, prioritise
from monochord.core.types import Block, Prediction, Signal, Tracked, Truth, Window
from monochord.core.units import Samples, Seconds
from monochord.core.windows import windows
from monochord.live import events, health
from monochord.live import filter as time_filter
from monochord.live.delivery import Delivered, Delivery
from monochord.live.settings import LiveRun, channels_of
from monochord.live.sinks.base import Run, Update
from monochord.live.summary import LoopMeter, Summary
from monochord.perception.watching import Watching
from monochord.physics.sensors import load_sensor, refuse_other_length, with_sensor
from monochord.physics.strings import load_string

NO_TRUTH: Truth = MappingProxyType({})
"""The truth of one of several strings: empty, since a source's truth names no string."""


def run(setup: LiveRun) -> Summary:
    """Run until the source ends, the time is over or the run is interrupted.

    A reader that is a hop or more behind its source skips to the newest window and counts the skipped ones. A
    sink that is slow or fails delays neither the loop nor other sinks; see `monochord.live.delivery`. Results
    do not depend on the source's pace, so a file always gives the same numbers.

    Parameters
    ----------
    setup
        Source, estimator, sinks, window and time limit.

    Returns
    -------
    Summary
        Counts and timings. A first Control-C or SIGTERM ends the loop after the current window without
        raising; then `interrupted` is true.

    Raises
    ------
    InputError
        If the source, the estimator or a sink rejects its options or the signal, or the priority is not
        permitted.
    DeviceError
        If a device is missing or lost for good.
    Exception
        The last sink's exception, if no sink is left.
    """
    with ExitStack() as stack:
        if setup.real_time:
            stack.enter_context(before_other_programs())
        stop = stack.enter_context(interruption())
        with stop.at_once():
            stream = stack.enter_context(setup.source.open())
        stack.enter_context(stop.ending(stream.close))
        live = LiveStream(setup, stream)
        opened_for = Run(
            signal=live.signal,
            strings={each.name: each.signal for each in live.strings if each.name},
            sensors=_sensors(setup),
            length=setup.estimator.string_length,
            model=setup.estimator.model,
            controls=stream.controls,
        )
        delivering = Delivery(setup.sinks, opened_for, paced=stream.paced)
        with delivering as delivery, _heap_set_aside() if stream.paced else nullcontext():
            if setup.real_time:
                prioritise(FIRST)  # of its own threads, too
            try:
                for update in live:
                    if stop.requested:
                        break
                    delivery.hand_over(update)
            except KeyboardInterrupt:
                stop.requested = True
        return live.summary(interrupted=stop.requested, delivered=delivery.delivered)


@contextmanager
def opened(setup: LiveRun) -> Generator["LiveStream"]:
    """Open the source and prepare the estimator; leaving the context releases the source.

    Raises `InputError` where one of them rejects its options or the signal, `DeviceError` for a missing
    device.
    """
    with setup.source.open() as stream:
        yield LiveStream(setup, stream)


class LiveStream:
    """The windows of an open source with their estimates; iterating it is the live loop.

    Attributes
    ----------
    signal
        The audio format of the windows, with the run's string (the first of several): the source's, at the
        estimator's sample rate.
    strings
        The strings of the source; a single string has no name.
    """

    def __init__(self, setup: LiveRun, stream: Stream) -> None:
        stream = at_rate(stream, setup.estimator.sample_rate)
        self._stream, self._seconds = stream, setup.seconds
        self._filter, self._health = setup.filter, setup.health
        self.signal, self.strings = _strings(stream.signal, setup)
        self._size, self._hop = setup.window.frames(self.signal.sample_rate)
        self._estimator = setup.estimator
        self._prepared = [self._estimator.prepare(each.signal, self._size) for each in self.strings]
        warm_up = [_sawtooth(each.signal, self._size) for each in self.strings]
        # What loads or compiles at first use does so now.
        self._estimator.estimate_all(self._prepared, warm_up)
        health.warm_up(warm_up[0])
        self._feed = _TimedBlocks(stream, self.signal.sample_rate)
        self._meter = LoopMeter(deadline=self._hop / self.signal.sample_rate)
        self._closed = False

    def close(self) -> None:
        """End the iteration; may be called from any thread."""
        self._closed = True
        self._stream.close()

    def summary(self, *, interrupted: bool = False, delivered: tuple[Delivered, ...] = ()) -> Summary:
        """Return the counts and timings so far."""
        self._meter.interrupted = interrupted
        return self._meter.summary(self._feed.frames, self._stream.health, delivered)

    def __iter__(self) -> Iterator[Update]:
        """Yield an update for each window of each string, those of one time in turn.

        The time until the next request counts as the sinks' time.
        """
        stream, feed, meter, size, hop = self._stream, self._feed, self._meter, self._size, self._hop
        rate, count = self.signal.sample_rate, len(self.strings)
        clock, length = SampleClock(sample_rate=rate), size / rate
        states = [_StringState()] * count
        skipped = 0
        for window in windows(feed, size=size, hop=hop, sample_rate=rate):
            end = window.start + size
            if self._closed or clock.time(end) > self._seconds:
                return
            if stream.pending >= hop:
                skipped += 1
                meter.skip(count)
                continue
            cut = time.monotonic()
            cuts = [each.cut(window) for each in self.strings]
            estimates = self._estimator.estimate_all(self._prepared, cuts)
            done = begun = time.monotonic()
            adc_time, counters = feed.captured(window.start), stream.health
            for k, string in enumerate(self.strings):
                prediction = Prediction(
                    start=window.start,
                    time=clock.time(window.start),
                    estimates=estimates[k],
                    latency=done - feed.at_hand,
                )
                state, estimate = states[k], self._prepared[k]
                followed, tracked = time_filter.step(state.followed, prediction, length, self._filter)
                offset = None if adc_time is None else adc_time - prediction.time
                announced, changes = events.step(state.announced, followed, tracked, offset)
                condition = estimate.condition if isinstance(estimate, Watching) else None
                checked, notes = health.step(
                    state.sensor_health,
                    cuts[k],
                    estimates[k],
                    counters,
                    skipped,
                    followed,
                    condition,
                    self._health,
                )
                states[k] = _StringState(followed=followed, announced=announced, sensor_health=checked)
                handed = time.monotonic()
                yield Update(
                    prediction=prediction,
                    window=cuts[k],
                    health=counters,
                    truth=NO_TRUTH if string.name else stream.truth(window.start, end),
                    skipped=skipped,
                    tracked=Tracked(estimates=tracked.estimates),
                    decided=tracked.decided,
                    events=changes,
                    notes=notes,
                    condition=condition,
                    adc_time=adc_time,
                    at_hand=feed.at_hand,
                    string=string.name,
                )
                written = time.monotonic()
                meter.add(
                    prediction,
                    read=cut - feed.at_hand,
                    estimate=done - cut,
                    follow=handed - begun,
                    sinks=written - handed,
                )
                begun = written
                if not window.has_gap:
                    meter.add_capture(feed.captured(end), done)


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveString:
    """One string of a run: its name (empty for a single string), signal, and channels, counted from 0."""

    name: str
    signal: Signal
    channels: tuple[int, ...]

    def cut(self, window: Window) -> Window:
        """Return this string's part of a source's window."""
        if not self.name:
            return window
        first, last = self.channels[0], self.channels[-1]
        rows = slice(first, last + 1) if last + 1 - first == len(self.channels) else list(self.channels)
        return dataclasses.replace(window, samples=window.samples[rows])


@dataclass(frozen=True, slots=True, kw_only=True)
class _StringState:
    """The time-dependent state of one string."""

    followed: time_filter.FilterState = field(default_factory=time_filter.FilterState)
    announced: events.AnnouncedState = field(default_factory=events.AnnouncedState)
    sensor_health: health.HealthState = field(default_factory=health.HealthState)


class _TimedBlocks:
    """The blocks of a stream as they pass, with the time at which the newest was available."""

    def __init__(self, stream: Stream, sample_rate: int) -> None:
        self._stream = stream
        self._rate = sample_rate
        self._block: Block | None = None
        self.at_hand: Seconds = 0.0
        self.frames: Samples = 0

    def __iter__(self) -> Iterator[Block]:
        for block in self._stream.in_time():
            self._block, self.at_hand = block, time.monotonic() - self._stream.delay
            self.frames += block.samples.shape[1]
            if block.adc_time is not None:
                # The block may have waited for the reader; its last frame was there from this time on.
                converted = block.adc_time + block.samples.shape[1] / self._rate
                self.at_hand = min(self.at_hand, converted)
            yield block

    def captured(self, index: Samples) -> Seconds | None:
        """Return when the converter sampled the frame before `index`, where the source knows it."""
        block = self._block
        if block is None or block.adc_time is None:
            return None
        return block.adc_time + (index - block.start) / self._rate


def _sawtooth(signal: Signal, size: Samples) -> Window:
    """Return a window with twelve periods of a sawtooth, later than any: the next window starts a stream.

    Every other channel is half a period late, as no copy of the first is.
    """
    phase = np.arange(size) * 12.0 / size + 0.5 * np.arange(signal.channels)[:, np.newaxis]
    samples = (0.2 * (phase % 1.0 - 0.5)).astype(np.float32)
    return Window(samples=samples, start=sys.maxsize, sample_rate=signal.sample_rate)


def _strings(signal: Signal, setup: LiveRun) -> tuple[Signal, tuple[LiveString, ...]]:
    """Return the source's signal and its strings.

    Raises `InputError` where the source lacks a string's channels, or has more than two and no named strings.
    """
    if not setup.strings:
        if signal.channels > 2:
            given = f"{signal.channels} channels"
            raise InputError(
                given, "1 or 2 for one string", "name the strings: --sensor NAME=PRESET for each"
            )
        known = _with_string(signal, setup.string, setup.sensor)
        return known, (LiveString(name="", signal=known, channels=tuple(range(signal.channels))),)
    strings: list[LiveString] = []
    for name, channels in channels_of(setup.strings).items():
        if max(channels) > signal.channels:
            given = f"channel {max(channels)} of the string {name}"
            raise InputError(given, f"1 to {signal.channels}, the source's channels")
        settings = setup.strings[name]
        inherits = not (settings.string or settings.sensor)
        string, sensor = (setup.string, setup.sensor) if inherits else (settings.string, settings.sensor)
        part = dataclasses.replace(signal, channels=len(channels))
        strings.append(
            LiveString(
                name=name,
                signal=_with_string(part, string, sensor),
                channels=tuple(channel - 1 for channel in channels),
            )
        )
    return dataclasses.replace(signal, string=strings[0].signal.string), tuple(strings)


def _sensors(setup: LiveRun) -> dict[str, str]:
    """Return the named sensor of each string, of a single one under the empty name."""
    strings = setup.strings.items()
    return {name: each.sensor or setup.sensor for name, each in strings} if strings else {"": setup.sensor}


def _with_string(signal: Signal, preset: str, sensor: str) -> Signal:
    """Return the signal with a preset's string, or with a tuned sensor's string.

    Raises `InputError` for a string where the source provides one, and for a sensor of another length.
    """
    if sensor:
        known, string = load_sensor(sensor), signal.string
        if string is not None:
            what = f"sensor '{sensor}' for a source, with a string"
            refuse_other_length(known.string.length, string.length, what, "name the source's sensor")
        return with_sensor(signal, known)
    if not preset:
        return signal
    string = load_string(preset).string
    if signal.string is not None:
        allowed = "no string, since the source provides one"
        remedy = f"use it as INPUT: monochord live {preset} ..."
        raise InputError(f"string '{preset}'", allowed, remedy)
    return dataclasses.replace(signal, string=string)


@contextmanager
def _heap_set_aside() -> Generator[None]:
    """Exclude what is loaded so far from garbage collection, whose full passes would delay a paced loop."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
