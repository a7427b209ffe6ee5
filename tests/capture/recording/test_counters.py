import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.sessions.made import plain_readings

from monochord.capture.recording import RecordingState, record
from monochord.capture.recording import counters as counters_module
from monochord.capture.recording.counters import (
    PEAK_HOLD,
    SILENCE,
    FeedCounter,
    Levels,
    RecordingCounters,
    TimingCheck,
)  # fmt: skip
from monochord.capture.recording.pumps import InstrumentReadings, Pumps
from monochord.capture.sources.base import Source
from monochord.core.types import Block, Feed, InstrumentHealth, Readings

RATE = 44100
FRAMES = 512


def shift_of(begin_of: "list[float]", *, dropped: "dict[int, int] | None" = None) -> float:
    """Return the shift of a stream whose k-th block states that frame 0 was at `begin_of[k]`."""
    timing, start = TimingCheck(RATE), 0
    for k, begin in enumerate(begin_of):
        start += (dropped or {}).get(k, 0)
        timing.add(
            Block(samples=np.zeros((1, FRAMES), np.float32), start=start, adc_time=begin + start / RATE)
        )
        start += FRAMES
    return timing.shift


@pytest.mark.parametrize(
    ("delays", "dropped"),
    [
        (np.zeros(500), {}),
        (np.random.default_rng(0).exponential(2e-3, 2000), {}),
        (300e-6 * np.arange(3000) * FRAMES / RATE, {}),
        (np.zeros(500), {250: 44100}),
    ],
    ids=["steady", "jitter of single blocks", "two clocks that drift", "a counted gap"],
)
def test_what_is_no_shift(delays: np.ndarray, dropped: dict[int, int]) -> None:
    assert shift_of((5.0 + delays).tolist(), dropped=dropped) == 0.0


@pytest.mark.parametrize("periods", [1, -3])
def test_periods_that_were_not_counted_are(periods: int) -> None:
    lost = periods * FRAMES / RATE
    assert shift_of([5.0] * 250 + [5.0 + lost] * 250) == pytest.approx(lost, rel=1e-6)


def test_blocks_without_times_say_nothing() -> None:
    timing = TimingCheck(RATE)
    for k in range(100):
        timing.add(Block(samples=np.zeros((1, FRAMES), np.float32), start=k * FRAMES))
    assert timing.shift == 0.0


def levels_block(*channels: list[float]) -> Block:
    return Block(samples=np.array(channels, np.float32), start=0)


def test_each_microphone_has_its_level() -> None:
    levels = Levels(channels=2, sample_rate=RATE)
    levels.add(levels_block([0.3, -0.3], [0.0, 0.4]))
    levels.add(levels_block([0.3, -0.3], [-0.4, 0.0]))
    first, second = levels.look(0.0)
    assert first.rms == pytest.approx(0.3)
    assert second.rms == pytest.approx(0.4 / np.sqrt(2))
    assert (first.peak, second.peak) == pytest.approx((0.3, 0.4))
    assert not first.clipping


def test_a_peak_is_held_for_a_while_and_the_highest_for_ever() -> None:
    levels = Levels(channels=1, sample_rate=RATE)
    levels.add(levels_block([0.8]))
    levels.look(0.0)
    levels.add(levels_block([-0.2]))
    (soon,) = levels.look(0.9 * PEAK_HOLD)
    assert (soon.peak, soon.peak_hold) == pytest.approx((0.2, 0.8))
    levels.add(levels_block([0.1]))
    (later,) = levels.look(1.1 * PEAK_HOLD)
    assert (later.peak_hold, later.highest) == pytest.approx((0.1, 0.8))


@pytest.mark.parametrize("pieces", [1, 30])
def test_silence_is_timed_up_to_now_whatever_the_blocks(pieces: int) -> None:
    faint = 1e-2 + 1e-5 * np.random.default_rng(0).standard_normal(3 * RATE)  # a constant is no sound
    tone = 0.1 * np.sin(0.1 * np.arange(3 * RATE))
    tone[RATE:] = 0.0
    levels = Levels(channels=2, sample_rate=RATE)
    for part in np.array_split(np.stack((faint, tone)).astype(np.float32), pieces, axis=1):
        levels.add(Block(samples=part, start=0))
        levels.look(0.0)
    first, second = levels.look(0.0)
    assert (first.quiet, second.quiet) == pytest.approx((3.0, 2.0), abs=0.11)
    levels.add(Block(samples=np.full((2, 441), np.nan, np.float32), start=0))
    assert [level.quiet for level in levels.look(0.0)] == [0.0, 0.0]


FEED = Feed(stream="gripper", columns=("width", "force"), units=("m", "N"), rate=100.0)
HEALTH = InstrumentHealth(missing=3)


def readings(count: int, *, value: float = 1.0, status: int = 0) -> Readings:
    return plain_readings("gripper", np.zeros(count), np.full((count, 2), value), status=status)


def test_the_latest_reading_is_shown_and_the_rate_is_that_of_the_last_second() -> None:
    counter = FeedCounter("gripper", FEED, begin=0.0)
    counter.add(readings(100), 1.0)
    assert counter.look(1.0, HEALTH).rate == pytest.approx(100.0)
    counter.add(readings(10, value=2.0), 2.0)
    now = counter.look(2.0, HEALTH)
    assert now.rate == pytest.approx(10.0)
    assert now.values == {"width": 2.0, "force": 2.0}
    assert (now.readings, now.health) == (110, HEALTH)


@pytest.mark.parametrize(("rate", "patience"), [(7000.0, 0.5), (2.0, 2.5), (0.0, 2.0)])
def test_an_instrument_that_is_late_is_silent(rate: float, patience: float) -> None:
    feed = Feed(stream="gripper", columns=("width", "force"), units=("m", "N"), rate=rate)
    counter = FeedCounter("gripper", feed, begin=5.0)
    assert counter.look(5.0 + 1.1 * patience, HEALTH).silent > 0.0  # it never sent
    counter.add(readings(1), 10.0)
    assert counter.look(10.0 + 0.9 * patience, HEALTH).silent == 0.0
    assert counter.look(10.0 + 1.1 * patience, HEALTH).silent == pytest.approx(1.1 * patience)


def block(start: int, frames: int, dropped: int = 0) -> Block:
    return Block(samples=np.full((2, frames), 0.25, np.float32), start=start, dropped=dropped)


def test_the_counters_add_up_blocks_and_readings(make_job: Any, force: Any, tmp_path: Path) -> None:
    _, instrument = force()
    source: Source = make_job().source
    with source.open() as stream, instrument.open() as sensor:
        counters = RecordingCounters(stream, {"net_ft": sensor}, tmp_path, reserve=0.0)
        pumps = Pumps(stream, {"net_ft": sensor}, capacity=1000)
        counters.add(block(0, 64))
        counters.add(block(100, 64, dropped=36))
        counters.add(
            InstrumentReadings(name="net_ft", readings=plain_readings("wrench", np.zeros(5), np.ones((5, 6))))
        )
        now = counters.look(size=1000, pumps=pumps)
        assert (now.frames, now.dropped, now.gaps) == (128, 36, 1)
        assert counters.audio_end == 164 / RATE
        assert [feed.readings for feed in now.feeds] == [5]
        assert now.feeds[0].values["fz"] == 1.0
        assert [round(level.rms, 3) for level in now.levels] == [0.25, 0.25]
        assert now.space.size == 1000
        assert now.time - counters.begin == now.elapsed < 5.0


def test_audio_that_is_late_is_silent_unless_its_blocks_are_long(
    make_job: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    monkeypatch.setattr(counters_module.time, "monotonic", lambda: now)
    source: Source = make_job().source
    with source.open() as stream:
        counters = RecordingCounters(stream, {}, tmp_path, reserve=0.0)
        pumps = Pumps(stream, {}, capacity=1000)
        now += SILENCE + 0.05
        assert counters.look(0, pumps).silent > SILENCE
        counters.add(block(0, 64))
        assert counters.look(0, pumps).silent == 0.0
        counters.add(block(64, RATE))
        now += SILENCE + 0.05
        assert counters.look(0, pumps).silent == 0.0


def test_each_state_continues_the_one_before(make_job: Any, force: Any) -> None:
    looks: list[RecordingState] = []
    job = make_job(seconds=0.5, instruments={"net_ft": force()[1]})
    summary = record(job, lambda now, _notices: looks.append(now))
    assert len(looks) > 2
    assert looks[-1].space.size > looks[0].space.size
    assert looks[-1].frames == summary.frames
    for before, after in itertools.pairwise(looks):
        assert after.time > before.time
        assert after.frames >= before.frames
        assert after.space.size >= before.space.size
        assert after.feeds[0].readings >= before.feeds[0].readings
    assert looks[-1].elapsed - looks[0].elapsed == pytest.approx(looks[-1].time - looks[0].time)
