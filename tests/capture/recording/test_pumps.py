import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from monochord.capture.instruments.base import Connection
from monochord.capture.recording.pumps import Polled, pumping
from monochord.capture.sources.base import Stream
from monochord.core.types import Block, Feed, InstrumentHealth, Readings, Signal

FEED = Feed(stream="ticks", columns=("t",), units=("s",))
PLENTY = 1 << 20


def wait_for(condition: Callable[[], Any]) -> None:
    deadline = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(5e-3)


class Stuck(Stream):
    """A source that gives `blocks` and then waits for a server that does not come back."""

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
    """An instrument that has one reading each time it is asked, and fails after `lives` of them."""

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
        one, number = np.array([time.monotonic()]), np.array([self.polls])
        return [
            Readings(
                stream="ticks",
                time=one,
                values=one[:, None],
                sequence=number,
                device_time=number,
                status=np.zeros(1, np.uint32),
            )
        ]


def test_a_source_that_waits_holds_no_instrument_up() -> None:
    with pumping(Stuck(), {"ticks": Ticks()}, PLENTY) as pumps:
        wait_for(lambda: pumps.inbox.filled > 40 * 36 / PLENTY)
        batches = pumps.inbox.take()
        assert not pumps.source_ended
    assert [type(batch) for batch in batches].count(Block) == 1
    assert sum(isinstance(batch, Polled) and batch.name == "ticks" for batch in batches) > 30


def test_an_instrument_that_fails_ends_alone_and_is_told() -> None:
    with pumping(Stuck(), {"broken": Ticks(lives=2), "sound": Ticks()}, PLENTY) as pumps:
        wait_for(lambda: pumps.failures)
        before = pumps.inbox.take()
        time.sleep(0.1)
        assert len(pumps.inbox.take()) > 3
        assert list(pumps.failures) == ["broken"]
        assert not pumps.ended
    assert sum(isinstance(batch, Polled) and batch.name == "broken" for batch in before) == 2


def test_told_to_stop_all_end_and_what_came_is_still_there() -> None:
    ticks = Ticks()
    with pumping(Stuck(), {"ticks": ticks}, PLENTY) as pumps:
        wait_for(lambda: ticks.polls > 3)
        pumps.stop()
        wait_for(lambda: pumps.ended)
        assert sum(isinstance(batch, Polled) for batch in pumps.inbox.take()) == ticks.polls


def test_what_is_live_and_finds_no_room_waits_and_that_is_counted() -> None:
    ticks = Ticks()
    with pumping(Stuck(blocks=0), {"ticks": ticks}, room=40) as pumps:
        wait_for(lambda: ticks.polls == 2)  # one fits, the next waits
        time.sleep(0.1)
        assert ticks.polls == 2
        pumps.inbox.take()
        wait_for(lambda: pumps.held_up >= 0.1)


def test_leaving_lets_go_of_whoever_waits_for_room() -> None:
    with pumping(Stuck(blocks=1000), {"ticks": Ticks()}, room=300):
        time.sleep(0.05)
    assert not [t for t in threading.enumerate() if t.name.startswith("record")]


@pytest.mark.parametrize(("off", "doubted"), [(0.0, False), (-0.3, False), (0.2, True), (-4.2, True)])
def test_a_time_that_cannot_be_is_doubted(off: float, doubted: bool) -> None:  # noqa: FBT001
    with pumping(Stuck(blocks=3, off=off), {}, PLENTY) as pumps:
        wait_for(lambda: pumps.inbox.filled >= 3 * 256 / PLENTY)
        assert pumps.doubt == pytest.approx(-off if doubted else 0.0, abs=0.05)
