"""Updates handed to sinks that are slow, hang or fail."""

import logging
import math
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager

import pytest
from tests.live.sinks.made import SIGNAL, window_update

from monochord.live import delivery
from monochord.live.delivery import Delivered, Delivery
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import BACKLOG, NEWEST, Listener, NotDeliveredError, Run, Sink, Update, Writer


class Keep(Sink, Writer):
    """A sink that keeps the numbers of what it was given, and in which threads."""

    def __init__(self, before: Callable[[int], object] = id, *, fills_standard_output: bool = False) -> None:
        self.numbers: list[int] = []
        self.threads: set[int] = set()
        self.opened = self.closed = 0
        self._before, self._fills = before, fills_standard_output

    @property
    def fills_standard_output(self) -> bool:
        return self._fills

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        assert run.signal is SIGNAL
        self.opened += 1
        yield self
        self.closed += 1

    def write(self, update: Update) -> None:
        number = update.prediction.start // 441
        self._before(number)
        self.numbers.append(number)
        self.threads.add(threading.get_ident())


class Audience(Listener):
    def __init__(self, then: Callable[[int], object] = id) -> None:
        self.threads: set[int] = set()
        self._then = then

    def write(self, update: Update) -> None:
        self.threads.add(threading.get_ident())
        self._then(update.prediction.start // 441)


def fail_at(count: int, error: Exception) -> Callable[[int], None]:
    def before(number: int) -> None:
        if number == count:
            raise error

    return before


def play(sinks: list[Sink], *, paced: bool) -> None:
    """Hand over updates until something is raised."""
    with Delivery(sinks, Run(signal=SIGNAL), paced=paced) as delivering:
        for number in range(100_000):
            delivering.hand_over(window_update(number))
            time.sleep(1e-4)


def test_every_sink_gets_all_in_order_in_a_thread_of_its_own() -> None:
    keeps = [Keep(), Keep(), Keep()]
    with Delivery(keeps, Run(signal=SIGNAL), paced=True) as delivering:
        for number in range(200):
            delivering.hand_over(window_update(number))
    assert [keep.numbers for keep in keeps] == [list(range(200))] * 3
    assert len(set.union(*(keep.threads for keep in keeps), {threading.get_ident()})) == 4
    assert [(keep.opened, keep.closed) for keep in keeps] == [(1, 1)] * 3
    assert delivering.delivered == (Delivered(sink="test_delivery", written=200, left_out=0),) * 3


class Newest(Keep):
    """A sink whose reader acts on the newest window."""

    @property
    def backlog(self) -> int:
        return NEWEST


@pytest.mark.parametrize(("kind", "backlog"), [(Keep, BACKLOG), (Newest, NEWEST)])
def test_a_slow_sink_delays_nobody_and_what_it_misses_is_counted(kind: type[Keep], backlog: int) -> None:
    go = threading.Event()
    slow, quick = kind(lambda _: go.wait(60.0)), Keep()
    total = BACKLOG + 100
    with Delivery([slow, quick], Run(signal=SIGNAL), paced=True) as delivering:
        for number in range(total):
            delivering.hand_over(window_update(number))
            while len(quick.numbers) <= number:  # it, too, may be left behind by a loop without a pace
                time.sleep(1e-4)
        assert slow.numbers == []
        go.set()
    assert quick.numbers == list(range(total))
    # The one that it was busy with, unless it was woken late; and the newest.
    assert slow.numbers[-backlog:] == list(range(total - backlog, total))
    assert len(slow.numbers) in (backlog, backlog + 1)
    seen = delivering.delivered
    assert [each.written + each.left_out for each in seen] == [total, total]
    assert [each.left_out for each in seen] == [total - len(slow.numbers), 0]


@pytest.mark.parametrize("paced", [True, False])
def test_a_sink_that_fails_is_reported_and_closed_and_the_others_go_on(
    caplog: pytest.LogCaptureFixture, *, paced: bool
) -> None:
    bad, good = Keep(fail_at(3, OSError(28, "No space left on device"))), Keep()
    with (
        caplog.at_level(logging.WARNING),
        Delivery([bad, good], Run(signal=SIGNAL), paced=paced) as delivering,
    ):
        for number in range(50):
            delivering.hand_over(window_update(number))
    assert (bad.numbers, bad.closed) == ([0, 1, 2], 1)
    assert (good.numbers, good.closed) == (list(range(50)), 1)
    (message,) = caplog.messages
    assert "test_delivery" in message
    assert delivering.delivered == (
        Delivered(sink="test_delivery", written=3, left_out=47, failure="No space left on device"),
        Delivered(sink="test_delivery", written=50, left_out=0),
    )


def test_the_other_sinks_are_told_of_one_that_is_closed() -> None:
    class Notes(Keep):
        def write(self, update: Update) -> None:
            notes.append([(note.key, note.since) for note in update.notes])

    notes: list[list[tuple[str, float]]] = []
    full = Keep(fail_at(1, OSError(28, "No space left on device")))
    with Delivery([full, Notes()], Run(signal=SIGNAL), paced=False) as delivering:
        for number in range(5):
            delivering.hand_over(window_update(number))
    told = ("test_delivery_closed", 0.02)
    assert notes == [[], [], [told], [told], [told]]


@pytest.mark.parametrize("paced", [True, False])
def test_the_run_ends_with_the_error_of_the_last_sink(*, paced: bool) -> None:
    bad = [Keep(fail_at(3, OSError(28, "full"))), Keep(fail_at(9, ZeroDivisionError("its own fault")))]
    with pytest.raises(OSError, match="full"):
        play([*bad, Audience()], paced=paced)
    assert [keep.closed for keep in bad] == [1, 1]
    assert [keep.numbers for keep in bad] == [list(range(3)), list(range(9))]


@pytest.mark.parametrize("paced", [True, False])
def test_the_run_ends_where_the_reader_of_standard_output_left(
    caplog: pytest.LogCaptureFixture, *, paced: bool
) -> None:
    lines, other = Keep(fail_at(3, BrokenPipeError()), fills_standard_output=True), Keep()
    with pytest.raises(BrokenPipeError):
        play([lines, other], paced=paced)
    assert other.closed == 1
    assert not caplog.messages


@pytest.mark.parametrize("paced", [True, False])
def test_a_sink_may_fail_as_it_is_closed(*, paced: bool) -> None:
    class Full(Keep):
        @contextmanager
        def open(self, run: Run) -> Generator[Writer]:
            yield self
            raise OSError(28, "full")

    good = Keep()
    with Delivery([Full(), good], Run(signal=SIGNAL), paced=paced) as delivering:
        delivering.hand_over(window_update(0))
    assert [each.failure for each in delivering.delivered] == ["full", ""]
    with (
        pytest.raises(OSError, match="full"),
        Delivery([Full()], Run(signal=SIGNAL), paced=paced) as delivering,
    ):
        delivering.hand_over(window_update(0))


def test_a_sink_that_hangs_does_not_keep_the_run_from_ending(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delivery, "CLOSING", 0.2)
    never, good = threading.Event(), Keep()
    hanging = Keep(lambda _: never.wait(60.0))
    with Delivery([hanging, good], Run(signal=SIGNAL), paced=True) as delivering:
        for number in range(5):
            delivering.hand_over(window_update(number))
    assert hanging.numbers == []  # it still hangs
    never.set()
    assert good.numbers == list(range(5))
    hung = delivering.delivered[0]
    assert (hung.written, hung.left_out) == (0, 5)
    assert hung.failure


def test_a_window_that_a_sink_cannot_deliver_is_counted_and_it_goes_on() -> None:
    keep = Keep(fail_at(2, NotDeliveredError()))
    with Delivery([keep], Run(signal=SIGNAL), paced=True) as delivering:
        for number in range(5):
            delivering.hand_over(window_update(number))
    assert keep.numbers == [0, 1, 3, 4]
    assert delivering.delivered == (Delivered(sink="test_delivery", written=4, left_out=1),)


def test_what_robots_act_on_is_the_newest_and_files_have_all() -> None:
    backlogs = {name: SINKS.build(name).backlog for name in ("ros2", "udp", "csv", "mcap", "jsonl")}
    assert backlogs == {"ros2": NEWEST, "udp": NEWEST, "csv": BACKLOG, "mcap": BACKLOG, "jsonl": BACKLOG}


def test_without_a_pace_the_loop_waits_and_nothing_is_lost() -> None:
    slow = Keep(lambda _: time.sleep(1e-4))
    with Delivery([slow], Run(signal=SIGNAL), paced=False) as delivering:
        for number in range(2 * BACKLOG):
            delivering.hand_over(window_update(number))
    assert slow.numbers == list(range(2 * BACKLOG))
    assert slow.threads == {threading.get_ident()}


@pytest.mark.parametrize("paced", [True, False])
def test_a_listener_is_called_in_the_loop_and_what_it_raises_passes_through(*, paced: bool) -> None:
    listener, keep = Audience(fail_at(1, ZeroDivisionError())), Keep()
    with pytest.raises(ZeroDivisionError):
        play([listener, keep], paced=paced)
    assert listener.threads == {threading.get_ident()}
    assert keep.closed == 1


def test_a_sink_that_cannot_be_opened_closes_the_others() -> None:
    class Absent(Keep):
        @contextmanager
        def open(self, run: Run) -> Generator[Writer]:
            raise OSError(2, "not there")
            yield self

    before, first, usual = threading.active_count(), Keep(), sys.getswitchinterval()
    with (
        pytest.raises(OSError, match="not there"),
        Delivery([first, Absent()], Run(signal=SIGNAL), paced=True),
    ):
        pass
    assert first.closed == 1
    assert threading.active_count() == before
    assert math.isclose(sys.getswitchinterval(), usual)
