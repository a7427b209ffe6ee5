"""Counters of a running recording, in fixed memory: levels, instruments, timing, progress."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from monochord.capture.instruments.base import Connection
from monochord.capture.recording.disk import DiskSpace, space
from monochord.capture.recording.pumps import InstrumentReadings, Pumps
from monochord.capture.sources.base import Stream
from monochord.core.clipping import FULL_SCALE
from monochord.core.inputs import Inputs, InputState
from monochord.core.silence import is_silent
from monochord.core.types import Audio, Block, Feed, InstrumentHealth, Readings, StreamHealth
from monochord.core.units import Samples, Seconds
from monochord.dsp.microphones import compare_inputs

PEAK_HOLD: Seconds = 1.5
"""Time for which the highest peak is shown."""
SILENCE: Seconds = 0.5
"""Audio or an instrument is silent when its next data are this late, in s."""
SILENCE_UNKNOWN_RATE: Seconds = 2.0
"""Silence limit of an instrument of unknown rate, in s."""
OVERDUE_READINGS, OVERDUE_BLOCKS = 5, 4
"""A slow instrument, or audio in large blocks, is silent when this many readings or blocks are overdue."""
MIN_QUIET: Seconds = 1.0
"""How long a microphone picks up nothing before a warning, in s."""
QUIET_PIECE: Seconds = 0.1
"""Length of the pieces of sound that are checked for silence, and in which channels are compared, in s."""
MIN_PIECE: Seconds = 0.05
"""Least length of the sound by which two channels are compared, in s."""
RATE_INTERVAL: Seconds = 1.0
"""Interval over which an instrument's rate is measured, in s."""
TIMING_INTERVAL: Seconds = 1.0
"""Interval between comparisons of the device's times, in s."""
MIN_SHIFT: Seconds = 3e-3
"""Smallest shift per interval that is reported, in s; no converter's clock drifts that fast."""
MIN_BLOCKS = 4
"""Smallest number of blocks in an interval."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """The level of one microphone over the latest audio, in full scale.

    `peak_hold` is the highest peak of the last 1.5 s and `highest` that of the whole recording. `clipped` and
    `not_numbers` count samples since the start; `clipping` is true if any clipped in the last 1.5 s. `quiet`
    is the time in s for which the microphone has picked up nothing.
    """

    rms: float = 0.0
    peak: float = 0.0
    peak_hold: float = 0.0
    highest: float = 0.0
    clipped: Samples = 0
    not_numbers: Samples = 0
    clipping: bool = False
    quiet: Seconds = 0.0

    @property
    def is_silent(self) -> bool:
        """Whether the microphone has been silent long enough for a warning."""
        return self.quiet >= MIN_QUIET


class Levels:
    """Measures the level of all blocks since the last `look`.

    >>> levels = Levels(channels=1, sample_rate=44100)
    >>> levels.add(Block(samples=np.array([[0.5, -1.0]], np.float32), start=0))
    >>> levels.look(0.0)[0].clipped
    1
    """

    def __init__(self, channels: int, sample_rate: int) -> None:
        self._meters = [_Meter(sample_rate) for _ in range(channels)]
        self._blocks: list[Block] = []
        self._rate, self._state = sample_rate, InputState()

    @property
    def inputs(self) -> Inputs:
        """What two channels carry, by the blocks so far."""
        return self._state.inputs

    def add(self, block: Block) -> None:
        """Add a block."""
        self._blocks.append(block)

    def look(self, now: Seconds) -> tuple[Level, ...]:
        """Return each microphone's level over the blocks since the last call."""
        if self._blocks:
            samples = np.concatenate([block.samples for block in self._blocks], axis=1)
            self._blocks.clear()
            for meter, channel in zip(self._meters, samples, strict=True):
                meter.measure(channel, now)
            self._compare(samples[:, -round(QUIET_PIECE * self._rate) :])
        return tuple(meter.level(now) for meter in self._meters)

    def _compare(self, samples: Audio) -> None:
        """Look at the newest sound of two channels."""
        if len(samples) == 2 and samples.shape[1] >= MIN_PIECE * self._rate:
            self._state = self._state.after(compare_inputs(samples, self._rate))


class _Meter:
    def __init__(self, sample_rate: int) -> None:
        self._rate = sample_rate
        self._quiet: Samples = 0
        self._rms = self._peak = self._peak_hold = self._highest = 0.0
        self._hold_until = self._clipping_until = -np.inf
        self._clipped = self._not_numbers = 0

    def measure(self, channel: np.ndarray, now: Seconds) -> None:
        pieces = max(1, round(channel.size / (QUIET_PIECE * self._rate)))
        for piece in np.array_split(channel, pieces):
            self._quiet = self._quiet + piece.size if is_silent(piece) else 0
        with np.errstate(all="ignore"):
            peak = float(max(channel.max(initial=0.0), -channel.min(initial=0.0)))
        if not np.isfinite(peak):
            numbers = channel[np.isfinite(channel)]
            self._not_numbers += channel.size - numbers.size
            channel, peak = numbers, float(np.abs(numbers).max(initial=0.0))
        if peak >= FULL_SCALE:
            self._clipped += int(np.count_nonzero(np.abs(channel) >= FULL_SCALE))
            self._clipping_until = now + PEAK_HOLD
        self._peak, self._highest = peak, max(self._highest, peak)
        self._rms = float(np.sqrt(np.dot(channel, channel) / channel.size)) if channel.size else 0.0
        if peak >= self._peak_hold or now > self._hold_until:
            self._peak_hold, self._hold_until = peak, now + PEAK_HOLD

    def level(self, now: Seconds) -> Level:
        return Level(
            rms=self._rms,
            peak=self._peak,
            peak_hold=self._peak_hold,
            highest=self._highest,
            clipped=self._clipped,
            not_numbers=self._not_numbers,
            clipping=now < self._clipping_until,
            quiet=self._quiet / self._rate,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedState:
    """The state of one instrument.

    `values` holds the latest reading by column and `rate` the readings per second over the last second.
    `faulty` counts readings with a nonzero status; `status` is the latest one. `silent` is the time without
    data, 0 until the next reading is late.
    """

    name: str
    feed: Feed
    health: InstrumentHealth
    readings: int = 0
    faulty: int = 0
    status: int = 0
    rate: float = 0.0
    silent: Seconds = 0.0
    values: Mapping[str, float]


class FeedCounter:
    """Counts the readings of one open instrument from time `begin` on."""

    def __init__(self, name: str, feed: Feed, begin: Seconds) -> None:
        self._name, self._feed = name, feed
        self._silence = (
            max(SILENCE, OVERDUE_READINGS / feed.rate) if feed.rate > 0.0 else SILENCE_UNKNOWN_RATE
        )
        self._readings = self._faulty = self._status = 0
        self._latest_time = self._rate_time = begin
        self._rate_readings = 0
        self._rate = 0.0
        self._values: Mapping[str, float] = {}

    def add(self, readings: Readings, now: Seconds) -> None:
        """Count readings, at least one, which arrived by time `now`."""
        self._readings += len(readings.time)
        faulty = readings.status[readings.status != 0]
        if len(faulty):
            self._faulty += len(faulty)
            self._status = int(faulty[-1])
        self._latest_time = now
        self._values = dict(zip(self._feed.columns, readings.values[-1].tolist(), strict=True))

    def look(self, now: Seconds, health: InstrumentHealth) -> FeedState:
        """Return the state of the instrument."""
        if now - self._rate_time >= RATE_INTERVAL:
            self._rate = (self._readings - self._rate_readings) / (now - self._rate_time)
            self._rate_time, self._rate_readings = now, self._readings
        silent = now - self._latest_time
        return FeedState(
            name=self._name,
            feed=self._feed,
            health=health,
            readings=self._readings,
            faulty=self._faulty,
            status=self._status,
            rate=self._rate,
            silent=silent if silent > self._silence else 0.0,
            values=self._values,
        )


class TimingCheck:
    """Detects uncounted losses of frames from jumps in the time of frame 0.

    The time of frame 0 follows from each block's time and index. A server that is late for a period may lose
    it and continue its count; then the times jump relative to the frame indices. A slow drift between two
    clocks is not reported.

    >>> import numpy as np
    >>> timing = TimingCheck(1000)
    >>> for k in range(30):
    ...     late = 0.05 if k >= 10 else 0.0
    ...     timing.add(Block(samples=np.zeros((1, 100)), start=100 * k, adc_time=0.1 * k + late))
    >>> round(timing.shift, 3)
    0.05
    """

    def __init__(self, sample_rate: int) -> None:
        self._rate = sample_rate
        self._origins: list[Seconds] = []
        self._until: Seconds | None = None
        self._origin: Seconds | None = None
        self.shift: Seconds = 0.0

    def add(self, block: Block) -> None:
        """Add the next block; one without a time is ignored."""
        if block.adc_time is None:
            return
        if self._until is None:
            self._until = block.adc_time + TIMING_INTERVAL
        self._origins.append(block.adc_time - block.start / self._rate)
        if block.adc_time >= self._until and len(self._origins) >= MIN_BLOCKS:
            origin = median(self._origins)
            step = 0.0 if self._origin is None else origin - self._origin
            self.shift += step if abs(step) > MIN_SHIFT else 0.0
            self._origin, self._until = origin, block.adc_time + TIMING_INTERVAL
            self._origins.clear()


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingState:
    """The state of a running recording.

    `time` is the monotonic clock and `elapsed` the time since the start. `frames`, `dropped` and `gaps` count
    the blocks received; `silent` is the time without audio, 0 until the next block is late. `levels` holds
    the microphones, `inputs` is what two channels carry, and `feeds` holds the instruments. `waiting` is the
    filled share of the write queue, and `blocked` the time that devices waited for space in it.
    `implausible_age` is the age of the latest block by the source's clock where that is impossible, else 0;
    `time_shift` is the shift of the source's times against its frames.
    """

    time: Seconds
    elapsed: Seconds
    frames: Samples
    dropped: Samples
    gaps: int
    silent: Seconds
    health: StreamHealth
    levels: tuple[Level, ...]
    inputs: Inputs = Inputs.UNKNOWN
    feeds: tuple[FeedState, ...]
    space: DiskSpace
    waiting: float = 0.0
    blocked: Seconds = 0.0
    implausible_age: Seconds = 0.0
    time_shift: Seconds = 0.0


class RecordingCounters:
    """Counts a recording from now on, written into a file in `folder`.

    `stream` is the source, `connections` the instruments by name. `reserve` is the number of bytes of the
    disk that stay free.
    """

    def __init__(
        self, stream: Stream, connections: Mapping[str, Connection], folder: Path, reserve: float
    ) -> None:
        self.begin = self._latest_time = time.monotonic()
        self._stream, self._connections = stream, connections
        self._folder, self._reserve = folder, reserve
        self._rate = stream.signal.sample_rate
        self._levels = Levels(stream.signal.channels, self._rate)
        self._timing = TimingCheck(self._rate)
        self._feeds = {name: FeedCounter(name, open_.feed, self.begin) for name, open_ in connections.items()}
        self._frames = self._dropped = self._gaps = self._end = 0
        self._silence = SILENCE

    @property
    def audio_end(self) -> Seconds:
        """Duration of the audio, including lost frames."""
        return self._end / self._rate

    def add(self, batch: Block | InstrumentReadings) -> None:
        """Count a block or readings."""
        now = time.monotonic()
        if isinstance(batch, InstrumentReadings):
            self._feeds[batch.name].add(batch.readings, now)
            return
        frames = batch.samples.shape[1]
        self._frames += frames
        self._dropped += batch.dropped
        self._gaps += batch.dropped > 0
        self._end = batch.start + frames
        self._latest_time = now
        self._silence = max(SILENCE, OVERDUE_BLOCKS * frames / self._rate)
        self._levels.add(batch)
        self._timing.add(batch)

    def look(self, size: int, pumps: Pumps) -> RecordingState:
        """Return the state of the recording, whose file has `size` bytes."""
        now = time.monotonic()
        silent, elapsed = now - self._latest_time, now - self.begin
        return RecordingState(
            time=now,
            elapsed=elapsed,
            frames=self._frames,
            dropped=self._dropped,
            gaps=self._gaps,
            silent=silent if silent > self._silence else 0.0,
            health=self._stream.health,
            levels=self._levels.look(now),
            inputs=self._levels.inputs,
            feeds=tuple(feed.look(now, self._connections[name].health) for name, feed in self._feeds.items()),
            space=space(self._folder, size=size, elapsed=elapsed, reserve=self._reserve),
            waiting=pumps.queue.filled,
            blocked=pumps.blocked,
            implausible_age=pumps.implausible_age,
            time_shift=self._timing.shift,
        )
