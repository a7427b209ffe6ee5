"""Signals of the process itself: the first is a stop, the second is not."""

import os
import signal
import threading

import pytest

from monochord.core.interruption import interruption


def strike(number: signal.Signals) -> None:
    os.kill(os.getpid(), number)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_first_signal_requests_the_end_and_closes_the_stream(number: signal.Signals) -> None:
    closed: list[str] = []
    with interruption() as stop:
        with stop.ending(lambda: closed.append(threading.current_thread().name)):
            assert not stop.requested
            strike(number)
            assert stop.requested
        assert closed != [threading.main_thread().name]
        assert len(closed) == 1


def test_the_second_signal_interrupts() -> None:
    before = signal.getsignal(signal.SIGINT)
    with interruption():
        strike(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            strike(signal.SIGTERM)
    assert signal.getsignal(signal.SIGINT) is before


def test_a_stream_opened_after_the_signal_is_closed_at_once() -> None:
    closed: list[bool] = []
    with interruption() as stop:
        strike(signal.SIGTERM)
        with stop.ending(lambda: closed.append(True)):
            assert closed == [True]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_what_is_ignored_stays_ignored(number: signal.Signals) -> None:
    before = signal.signal(number, signal.SIG_IGN)
    try:
        with interruption() as stop:
            strike(number)
            assert not stop.requested
        assert signal.getsignal(number) is signal.SIG_IGN
    finally:
        signal.signal(number, before)


def test_another_thread_takes_no_signals() -> None:
    seen: list[object] = []

    def enter() -> None:
        with interruption():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=enter)
    thread.start()
    thread.join()
    assert seen == [signal.getsignal(signal.SIGINT)]
