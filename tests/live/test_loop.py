"""The loop with a scripted source: everything that the source says must come out at the sinks."""

import dataclasses
import gc
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import pytest

from monochord.capture.jack.machine import OK, priority
from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Source, Stream
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Audio, Block, Estimate, Prepared, Signal, StreamHealth, Truth, Window
from monochord.live import LiveRun, WindowSettings, run
from monochord.live.loop import opened
from monochord.live.sinks.base import Listener, Run, Sink, Update, Writer
from monochord.perception.estimators.base import Estimator
from monochord.perception.watching import Condition, Watching
from monochord.physics.sensors import load_sensor

RATE = 1000
NOISE = np.random.default_rng(5).standard_normal((2, 2000)).astype(np.float32)


def cut(samples: Audio, size: int) -> list[Block]:
    total = samples.shape[1]
    return [Block(samples=samples[:, k : k + size], start=k) for k in range(0, total, size)]


class Script(Source, Stream):
    """A source that plays blocks; `behind` says how many frames wait once a block was given."""

    def __init__(self, blocks: list[Block], behind: Mapping[int, int] | None = None) -> None:
        self.blocks, self.behind = blocks, behind or {}
        self.given = self.waiting = 0
        self.closed = False

    @contextmanager
    def open(self) -> Generator[Stream]:
        try:
            yield self
        finally:
            self.closed = True

    @property
    def signal(self) -> Signal:
        return Signal(sample_rate=RATE, channels=self.blocks[0].samples.shape[0])

    def __iter__(self) -> Iterator[Block]:
        for k, block in enumerate(self.blocks):
            self.waiting = self.behind.get(k, 0)
            self.given += block.samples.shape[1]
            yield block

    @property
    def pending(self) -> int:
        return self.waiting

    @property
    def health(self) -> StreamHealth:
        return StreamHealth(frames=self.given, dropped=7, gaps=1, xruns=2)

    def truth(self, start: int, stop: int) -> Truth:
        return {"contact": 1.0, "position": (start + stop) / 1e4}


@dataclass(frozen=True, kw_only=True)
class Mean(Estimator):
    """The mean of a window as its position; abstains on a gap."""

    pause: float = 0.0

    def prepare(self, signal: Signal, size: int) -> Prepared:
        def estimate(window: Window) -> dict[str, Estimate]:
            assert window.samples.shape == (signal.channels, size)
            time.sleep(self.pause)
            if window.has_gap:
                return {"position": Estimate.abstain("m", "gap")}
            return {"position": Estimate(value=float(window.samples.mean()), std=0.1, unit="m")}

        return estimate


class Keep(Sink, Writer):
    """A sink that keeps what it is handed."""

    def __init__(self, then: Callable[[int], object] | None = None) -> None:
        self.seen: list[Update] = []
        self.closed = False
        self.then = then

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        try:
            yield self
        finally:
            self.closed = True

    def write(self, update: Update) -> None:
        self.seen.append(update)
        if self.then:
            self.then(len(self.seen))


def session(source: Source, keep: Keep, *, pause: float = 0.0, seconds: float = math.inf) -> LiveRun:
    return LiveRun(
        source=source,
        estimator=Mean(pause=pause),
        sinks=(keep,),
        window=WindowSettings(length=0.1, hop=0.01),
        seconds=seconds,
    )


def values(keep: Keep) -> list[tuple[float, float]]:
    return [(m.prediction.time, m.prediction.estimates["position"].value) for m in keep.seen]


@pytest.mark.parametrize("size", [1, 333, 2000])
def test_numbers_do_not_depend_on_the_block_size(size: int) -> None:
    keep = Keep()
    summary = run(session(Script(cut(NOISE, size)), keep))
    expected = [(k / 100, float(NOISE[:, 10 * k : 10 * k + 100].mean())) for k in range(191)]
    assert values(keep) == expected
    assert (summary.windows, summary.valid, summary.skipped, summary.frames) == (191, 191, 0, 2000)


def test_a_moment_carries_truth_health_and_window() -> None:
    keep = Keep()
    run(session(Script(cut(NOISE, 100)), keep))
    update = keep.seen[4]
    assert update.prediction.start == 40
    assert update.truth == {"contact": 1.0, "position": pytest.approx((40 + 140) / 1e4)}
    assert update.health == StreamHealth(frames=200, dropped=7, gaps=1, xruns=2)
    np.testing.assert_array_equal(update.window.samples, NOISE[:, 40:140])


def test_a_late_reader_skips_to_the_newest_window_and_counts() -> None:
    # After the blocks 30 to 49 ten frames or more wait: those windows are left out, and only those.
    late = dict.fromkeys(range(30, 50), 10)
    keep = Keep()
    summary = run(session(Script(cut(NOISE, 10), late), keep))
    starts = [m.prediction.start for m in keep.seen]
    left_out = [10 * (k - 9) for k in range(30, 50)]
    assert starts == [start for start in range(0, 1910, 10) if start not in left_out]
    assert summary.skipped == len(left_out) == keep.seen[-1].skipped
    assert keep.seen[0].skipped == 0


def test_less_than_a_hop_waiting_is_not_late() -> None:
    keep = Keep()
    summary = run(session(Script(cut(NOISE, 10), dict.fromkeys(range(200), 9)), keep))
    assert summary.skipped == 0


def test_a_gap_reaches_the_estimator_at_the_same_pace() -> None:
    blocks = [Block(samples=NOISE[:, :500], start=0), Block(samples=NOISE[:, 530:], start=530, dropped=30)]
    keep = Keep()
    summary = run(session(Script(blocks), keep))
    touched = [m.prediction.start for m in keep.seen if not m.prediction.estimates["position"].valid]
    assert touched == list(range(410, 530, 10))
    assert [m.prediction.start for m in keep.seen] == list(range(0, 1910, 10))
    assert summary.windows - summary.valid == len(touched)


def test_latency_counts_from_the_converter_where_the_source_knows_it() -> None:
    now = time.monotonic()
    block = Block(samples=NOISE[:, :100], start=0, adc_time=now - 5.1)
    keep = Keep()
    summary = run(session(Script([block]), keep))
    longest = 5.0 + time.monotonic() - now  # the window begins with the block, and is 0.1 s long
    assert 5.0 <= keep.seen[0].prediction.latency <= longest
    assert 5.0 <= summary.stages["capture"].longest <= longest
    assert summary.deadline_misses == 1


def test_latency_counts_from_arrival_otherwise() -> None:
    keep = Keep()
    summary = run(session(Script(cut(NOISE[:, :100], 100)), keep, pause=0.03))
    assert keep.seen[0].prediction.latency >= 0.03
    assert summary.stages["estimate"].p50 >= 0.03
    assert summary.stages["capture"].count == 0
    assert summary.deadline_misses == 1


def test_interrupting_ends_with_the_summary() -> None:
    def interrupt(count: int) -> None:
        if count == 3:
            raise KeyboardInterrupt

    source, keep = Script(cut(NOISE, 100)), Keep(interrupt)
    summary = run(session(source, keep))
    assert summary.interrupted
    assert len(keep.seen) == 3
    assert source.closed
    assert keep.closed


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_after_the_window_at_hand(sent: signal.Signals) -> None:
    usual = signal.getsignal(sent)
    keep = Keep(lambda count: os.kill(os.getpid(), sent) if count == 3 else None)
    summary = run(session(Script(cut(NOISE, 100)), keep))
    assert summary.interrupted
    assert summary.windows == len(keep.seen) == 3
    assert keep.closed
    assert signal.getsignal(sent) is usual


def test_a_device_that_goes_away_for_good_closes_everything_and_is_raised() -> None:
    def fail(count: int) -> None:
        raise DeviceError("the server is gone")

    source, keep = Script(cut(NOISE, 100)), Keep(fail)
    with pytest.raises(DeviceError, match="gone"):
        run(session(source, keep))
    assert source.closed
    assert keep.closed
    assert gc.get_freeze_count() == 0


def test_seconds_of_the_stream_are_looked_at() -> None:
    keep = Keep()
    summary = run(session(Script(cut(NOISE, 100)), keep, seconds=0.5))
    assert summary.windows == 41
    assert keep.seen[-1].prediction.start + 100 == 500


def test_a_string_that_is_unknown_or_beside_a_source_that_knows_its_own_is_refused() -> None:
    with pytest.raises(InputError, match="'appendix'"):
        run(LiveRun(source=SOURCES.build("split_string"), estimator=Mean(), string="appendix"))
    for source in (SOURCES.build("split_string"), Script(cut(NOISE, 100))):
        with pytest.raises(InputError, match="'apendix'"):
            run(LiveRun(source=source, estimator=Mean(), string="apendix"))


class Paced(Script):
    """A source that a clock paces, twenty times as fast as it would be."""

    @property
    def paced(self) -> bool:
        return True

    def __iter__(self) -> Iterator[Block]:
        for block in super().__iter__():
            time.sleep(5e-4)
            yield block


def test_a_sink_that_hangs_costs_a_paced_loop_nothing_and_the_others_get_all() -> None:
    go, keep = threading.Event(), Keep()
    hanging = Keep(lambda _: go.wait(60.0))
    both = dataclasses.replace(session(Paced(cut(NOISE, 10)), keep), sinks=(hanging, keep))
    threading.Timer(0.5, go.set).start()
    summary = run(both)
    assert (summary.windows, summary.skipped) == (191, 0)
    assert len(keep.seen) == len(hanging.seen) == 191
    assert [(each.written, each.left_out) for each in summary.delivered] == [(191, 0), (191, 0)]
    assert keep.closed
    assert hanging.closed


def test_a_moment_says_when_its_sound_was_taken_and_at_hand() -> None:
    block = Block(samples=NOISE[:, :110], start=0, adc_time=50.0)
    keep = Keep()
    run(session(Script([block]), keep))
    taken = [(m.adc_time, m.at_hand) for m in keep.seen]
    assert taken == [
        (pytest.approx(50.0), pytest.approx(50.11)),
        (pytest.approx(50.01), pytest.approx(50.11)),
    ]


class Following(Estimator, Watching):
    """An estimator that watches a string, which rises by 1 Hz a window."""

    def __init__(self) -> None:
        self.windows = 0

    def prepare(self, signal: Signal, size: int) -> Prepared:
        return self

    def __call__(self, window: Window) -> dict[str, Estimate]:
        self.windows += 1
        return {}

    @property
    def condition(self) -> Condition:
        return Condition(open_frequency=Estimate(value=float(self.windows), std=0.5, unit="Hz"))


def test_a_moment_has_what_the_estimator_knows_of_the_string() -> None:
    keep = Keep()
    run(replace(session(Script(cut(NOISE, 64)), keep), estimator=Following()))
    pitches = [m.condition and m.condition.open_frequency.value for m in keep.seen]
    assert pitches == [float(k + 2) for k in range(191)]  # after one of the warm-up
    run(session(Script(cut(NOISE, 64)), keep := Keep()))
    assert {m.condition for m in keep.seen} == {None}


def scheduled() -> tuple[int, int]:
    return os.sched_getscheduler(0), os.sched_getparam(0).sched_priority


@pytest.mark.skipif(priority().state != OK, reason="real-time priority is not granted to this user")
def test_with_real_time_priority_the_loop_comes_before_its_sinks() -> None:
    before, seen = scheduled(), {"loop": set[tuple[int, int]](), "sink": set[tuple[int, int]]()}

    class Noted(Listener):
        def write(self, update: Update) -> None:
            seen["loop"].add(scheduled())

    sink = Keep(then=lambda _: seen["sink"].add(scheduled()))
    setup = session(Paced(cut(NOISE, 100)), sink)
    run(replace(setup, sinks=(sink, Noted()), real_time=True))
    assert seen == {"loop": {(os.SCHED_RR, 2)}, "sink": {(os.SCHED_RR, 1)}}
    assert scheduled() == before


def test_a_user_who_may_not_have_real_time_priority_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    source = Script(cut(NOISE, 100))
    with pytest.raises(InputError):
        run(replace(session(source, Keep()), real_time=True))
    assert not source.given


def test_the_signal_of_a_run_has_what_is_known_of_the_sensor() -> None:
    design = load_sensor("prototype")
    places = tuple((each.sense, each.drive) for each in design.drivers)
    unknown = session(Script(cut(NOISE, 100)), Keep())
    twin = session(SOURCES.build("twin", {"speed": 0.0}), Keep())
    for setup, expected in (
        (unknown, (None, ())),
        (replace(unknown, string="appendix"), (None, ())),
        (replace(unknown, sensor="prototype"), (design.range, places)),
        (twin, (design.range, places)),
    ):
        with opened(setup) as live:
            assert (live.signal.sensing_range, live.signal.drivers) == expected
            assert [each.signal for each in live.strings] == [live.signal]
