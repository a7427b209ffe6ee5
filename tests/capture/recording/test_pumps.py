import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from tests.sessions.made import plain_readings
from tests.waiting import wait_for

from monochord.capture.instruments.base import Connection
from monochord.capture.recording.pumps import BoundedQueue, InstrumentReadings, pumping
from monochord.capture.sources.base import Stream
from monochord.core.types import Block, Feed, InstrumentHealth, Readings, Signal

FEED = Feed(stream="ticks", columns=("t",), units=("s",))
PLENTY = 1 << 20


class Stuck(Stream):
    """A source that yields `blocks` and then waits for a server that does not come back."""

    def __init__(self, blocks: int = 1, off: float = 0.0) -> None:
        self._blocks, self._off, self._closed = blocks, off, threading.Event()

    @property
    def signal(self) -> Signal:
        return Signal(sample_rate=44100, channels=1)

    def __iter__(self) -> Iterator[Block]:
        for k in range(self._blocks):
            now = time.monotonic() + self._off
            yield Block(samples=np.zeros((1, 64), np.float32), start=64 * k, adc_time=now)
        self._closed.wait(20.0)

    def close(self) -> None:
        self._closed.set()


class Ticks(Connection):
    """An instrument that has one reading each poll, and fails after `lives` of them."""

    def __init__(self, lives: float = float("inf")) -> None:
        self.polls, self._lives = 0, lives

    @property
    def feed(self) -> Feed:
        return FEED

    @property
    def health(self) -> InstrumentHealth:
        return InstrumentHealth(readings=self.polls)

    def poll(self) -> list[Readings]:
        if self.polls >= self._lives:
            raise OSError(5, "unplugged")
        self.polls += 1
        now = np.array([time.monotonic()])
        return [plain_readings("ticks", now, now[:, None], sequence=np.array([self.polls]))]


def test_a_source_that_waits_blocks_no_instrument() -> None:
    with pumping(Stuck(), {"ticks": Ticks()}, PLENTY) as pumps:
        wait_for(lambda: pumps.queue.filled > 40 * 36 / PLENTY)
        batches = pumps.queue.take()
        assert not pumps.source_ended
    assert [type(batch) for batch in batches].count(Block) == 1
    assert sum(isinstance(batch, InstrumentReadings) and batch.name == "ticks" for batch in batches) > 30


def test_an_instrument_that_fails_ends_alone_and_is_reported() -> None:
    with pumping(Stuck(), {"broken": Ticks(lives=2), "sound": Ticks()}, PLENTY) as pumps:
        wait_for(lambda: pumps.failures)
        before = pumps.queue.take()
        time.sleep(0.1)
        assert len(pumps.queue.take()) > 3
        assert list(pumps.failures) == ["broken"]
        assert not pumps.ended
    assert sum(isinstance(batch, InstrumentReadings) and batch.name == "broken" for batch in before) == 2


def test_after_stop_all_threads_end_and_their_data_remain() -> None:
    ticks = Ticks()
    with pumping(Stuck(), {"ticks": ticks}, PLENTY) as pumps:
        wait_for(lambda: ticks.polls > 3)
        pumps.stop()
        wait_for(lambda: pumps.ended)
        assert sum(isinstance(batch, InstrumentReadings) for batch in pumps.queue.take()) == ticks.polls


def test_live_data_wait_for_space_and_the_time_is_counted() -> None:
    ticks = Ticks()
    with pumping(Stuck(blocks=0), {"ticks": ticks}, capacity=40) as pumps:
        wait_for(lambda: ticks.polls == 2)  # one fits, the next waits
        time.sleep(0.1)
        assert ticks.polls == 2
        pumps.queue.take()
        wait_for(lambda: pumps.blocked >= 0.1)


def test_leaving_releases_waiting_threads() -> None:
    with pumping(Stuck(blocks=1000), {"ticks": Ticks()}, capacity=300):
        time.sleep(0.05)
    assert not [t for t in threading.enumerate() if t.name.startswith("record")]


@pytest.mark.parametrize(("off", "implausible"), [(0.0, False), (-0.3, False), (0.2, True), (-4.2, True)])
def test_an_impossible_time_is_reported(off: float, implausible: bool) -> None:  # noqa: FBT001
    with pumping(Stuck(blocks=3, off=off), {}, PLENTY) as pumps:
        wait_for(lambda: pumps.queue.filled >= 3 * 256 / PLENTY)
        assert pumps.implausible_age == pytest.approx(-off if implausible else 0.0, abs=0.05)


def test_a_thread_that_finds_it_full_waits_and_nothing_is_lost() -> None:
    queue = BoundedQueue[int](capacity=10)
    pump = threading.Thread(target=lambda: [queue.put(k, size=4) for k in range(50)])
    pump.start()
    taken: list[int] = []
    while pump.is_alive():
        time.sleep(1e-3)
        batch = queue.take()
        assert len(batch) <= 2
        taken += batch
    assert taken + queue.take() == list(range(50))


def test_a_batch_larger_than_the_capacity_is_accepted_alone() -> None:
    queue = BoundedQueue[str](capacity=10)
    assert queue.put("large", size=100)
    waiting = threading.Thread(target=queue.put, args=("small", 1))
    waiting.start()
    waiting.join(0.05)
    assert waiting.is_alive()
    assert queue.take() == ["large"]
    waiting.join(5.0)
    assert queue.take() == ["small"]


@pytest.mark.parametrize("full", [False, True])
def test_a_closed_queue_accepts_nothing_and_blocks_nobody(full: bool) -> None:  # noqa: FBT001
    queue = BoundedQueue[str](capacity=10)
    if full:
        queue.put("first", size=10)
    answers: list[bool] = []
    waiting = threading.Thread(target=lambda: answers.append(queue.put("second", size=10)))
    queue.close() if not full else None
    waiting.start()
    if full:
        time.sleep(0.05)
        queue.close()
    waiting.join(5.0)
    assert answers == [False]
    assert queue.take() == (["first"] if full else [])
