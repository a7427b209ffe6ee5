import threading
import time

import pytest

from monochord.capture.recording.inbox import Inbox


def test_what_is_put_is_taken_once_and_in_order() -> None:
    inbox = Inbox[int](room=10)
    assert all(inbox.put(k, size=1) for k in range(5))
    assert inbox.filled == 0.5
    assert inbox.take() == [0, 1, 2, 3, 4]
    assert inbox.take() == []
    assert inbox.filled == 0.0


def test_whoever_finds_it_full_waits_and_nothing_is_lost() -> None:
    inbox = Inbox[int](room=10)
    pump = threading.Thread(target=lambda: [inbox.put(k, size=4) for k in range(50)])
    pump.start()
    taken: list[int] = []
    while pump.is_alive():
        time.sleep(1e-3)
        batch = inbox.take()
        assert len(batch) <= 2
        taken += batch
    assert taken + inbox.take() == list(range(50))


def test_a_batch_larger_than_the_room_goes_in_alone() -> None:
    inbox = Inbox[str](room=10)
    assert inbox.put("large", size=100)
    waiting = threading.Thread(target=inbox.put, args=("small", 1))
    waiting.start()
    waiting.join(0.05)
    assert waiting.is_alive()
    assert inbox.take() == ["large"]
    waiting.join(5.0)
    assert inbox.take() == ["small"]


@pytest.mark.parametrize("full", [False, True])
def test_a_closed_inbox_takes_nothing_and_holds_nobody(full: bool) -> None:  # noqa: FBT001
    inbox = Inbox[str](room=10)
    if full:
        inbox.put("first", size=10)
    answers: list[bool] = []
    waiting = threading.Thread(target=lambda: answers.append(inbox.put("second", size=10)))
    inbox.close() if not full else None
    waiting.start()
    if full:
        time.sleep(0.05)
        inbox.close()
    waiting.join(5.0)
    assert answers == [False]
    assert inbox.take() == (["first"] if full else [])
